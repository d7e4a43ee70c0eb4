#include "server/storage/calibration_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

class SqlRevisionStore final : public RevisionStore {
 public:
  explicit SqlRevisionStore(Gate& gate) : gate_(gate) {}

  Result<Revision> publish(const CalibrationId& id, const std::vector<NetworkId>& anchors,
                           std::string_view by, std::string_view note, UtcTime now,
                           const std::vector<Override>& overrides,
                           std::optional<std::uint64_t> decided_on) override {
    return write_value<Revision>(gate_, 1, [&](Connection& c) {
      return publish_revision(c, id, anchors, by, note, now, overrides, decided_on);
    });
  }
  Result<std::vector<Revision>> revisions(std::size_t limit, std::uint64_t before) override {
    return read_value<std::vector<Revision>>(
        gate_, [&](Connection& c) { return list_revisions(c, row_limit(limit), before); });
  }
  Result<std::vector<PublishedPosition>> published(std::optional<std::uint64_t> revision) override {
    return read_value<std::vector<PublishedPosition>>(
        gate_, [&](Connection& c) { return positions_of_revision(c, revision); });
  }
  Result<std::optional<PublishedPosition>> position(NetworkId network_id, std::uint64_t revision) override {
    return read_value<std::optional<PublishedPosition>>(
        gate_, [&](Connection& c) { return position_in_revision(c, network_id, revision); });
  }
  Result<std::vector<PublishedPosition>> history(NetworkId network_id) override {
    return read_value<std::vector<PublishedPosition>>(
        gate_, [&](Connection& c) { return positions_of_anchor(c, network_id); });
  }
  std::optional<std::uint64_t> changes() const override { return gate_.changes(); }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<RevisionStore> make_revision_store(Gate& gate) {
  return std::make_unique<SqlRevisionStore>(gate);
}

}  // namespace anchord::sql
