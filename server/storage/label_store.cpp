#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_label =
    "UPDATE uwb_range SET truth_distance_m = ifnull(?2, truth_distance_m), truth_los = ifnull(?3, truth_los) "
    "WHERE mission_key = ?1 AND (?4 IS NULL OR anchor = ?4) AND (?5 IS NULL OR tag = ?5) AND (?6 IS NULL OR "
    "t_ns >= ?6) AND (?7 IS NULL OR t_ns < ?7) RETURNING range_id";

class SqlLabelStore final : public LabelStore {
 public:
  explicit SqlLabelStore(Gate& gate) : gate_(gate) {}

  Result<std::uint64_t> label(const Filter& filter, const RangeTruth& truth) override {
    return write_value<std::uint64_t>(gate_, 1, [&](Connection& c) -> Result<std::uint64_t> {
      const auto key = mission_key(c, filter.mission);
      if (!key) return make_error(Errc::not_found, "no mission " + to_string(filter.mission));
      Query query(c, k_label);
      query << *key << truth.distance_m << truth.los << filter.anchor << filter.tag << filter.since
            << filter.until;
      std::uint64_t n = 0;
      while (query.step()) ++n;
      return n;
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<LabelStore> make_label_store(Gate& gate) { return std::make_unique<SqlLabelStore>(gate); }

}  // namespace anchord::sql
