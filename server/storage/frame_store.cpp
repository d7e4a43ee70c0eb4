#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_frame_insert =
    "INSERT INTO local_frame (id, name, site_id, definition_json, created_t_ns, version) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT DO NOTHING RETURNING version";
constexpr const char* k_frame_update =
    "UPDATE local_frame SET name = ?2, site_id = ?3, definition_json = ?4, created_t_ns = ?5, version = ?6 "
    "WHERE id = ?1 AND version = ?7 RETURNING version";
constexpr const char* k_frame_columns =
    "SELECT id, name, site_id, definition_json, created_t_ns, version FROM local_frame ";
constexpr const char* k_frame_remove =
    "DELETE FROM local_frame WHERE id = ?1 AND version = ?2 RETURNING version";

void bind(Query& query, const LocalFrame& f, std::uint64_t version) {
  query << f.id << f.name << f.site << f.definition << f.created << version;
}

std::vector<LocalFrame> all_frames(Query& query) {
  std::vector<LocalFrame> found;
  while (query.step()) {
    LocalFrame f;
    f.id = query.id<FrameId>();
    f.name = query.text();
    f.site = query.maybe([&] { return query.id<SiteId>(); });
    f.definition = query.document();
    f.created = query.time();
    f.version = query.as<std::uint64_t>();
    found.push_back(std::move(f));
  }
  return found;
}

class SqlFrameStore final : public FrameStore {
 public:
  explicit SqlFrameStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const LocalFrame& frame) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = missing_site(c, frame.site)) return error;
      Query query(c, k_frame_insert);
      bind(query, frame, frame.version);
      if (query.returned()) return std::nullopt;
      return make_error(Errc::conflict, "a frame named '" + frame.name + "' exists");
    });
  }
  Result<void> update(const LocalFrame& frame, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = missing_site(c, frame.site)) return error;
      Query named(c, std::string(k_frame_columns) + "WHERE name = ?1 AND id <> ?2");
      named << frame.name << frame.id;
      if (named.step()) return make_error(Errc::conflict, "a frame named '" + frame.name + "' exists");
      Query query(c, k_frame_update);
      bind(query, frame, expected_version + 1);
      query << expected_version;
      if (query.returned()) return std::nullopt;
      return make_error(Errc::conflict, "the frame was changed in the meantime");
    });
  }
  Result<LocalFrame> frame(const FrameId& id) override { return find("WHERE id = ?1", id); }
  Result<LocalFrame> frame(const std::string& name) override { return find("WHERE name = ?1", name); }
  Result<std::vector<LocalFrame>> frames(std::size_t limit, const std::optional<FrameId>& after) override {
    return read_value<std::vector<LocalFrame>>(gate_, [&](Connection& c) -> Result<std::vector<LocalFrame>> {
      Query query(c, std::string(k_frame_columns) + "WHERE id > ?1 ORDER BY id LIMIT ?2");
      const FrameId start = after.value_or(FrameId{});
      query << start << row_limit(limit);
      return all_frames(query);
    });
  }
  Result<std::vector<LocalFrame>> frames_of(const SiteId& site) override {
    return read_value<std::vector<LocalFrame>>(gate_, [&](Connection& c) -> Result<std::vector<LocalFrame>> {
      Query query(c, std::string(k_frame_columns) + "WHERE site_id = ?1 ORDER BY id");
      query << site;
      return all_frames(query);
    });
  }
  Result<void> remove(const FrameId& id, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_frame_remove);
      query << id << expected_version;
      if (query.returned()) return std::nullopt;
      Query known(c, std::string(k_frame_columns) + "WHERE id = ?1");
      known << id;
      if (known.step()) return make_error(Errc::conflict, "the frame was changed in the meantime");
      return absent("frame", id);
    });
  }

 private:
  template <class Key>
  Result<LocalFrame> find(const char* where, const Key& key) {
    return read_value<LocalFrame>(gate_, [&](Connection& c) -> Result<LocalFrame> {
      Query query(c, std::string(k_frame_columns) + where);
      query << key;
      auto found = all_frames(query);
      if (found.empty()) return make_error(Errc::not_found, "no such frame");
      return std::move(found.front());
    });
  }
  Gate& gate_;
};

}  // namespace

std::unique_ptr<FrameStore> make_frame_store(Gate& gate) { return std::make_unique<SqlFrameStore>(gate); }

}  // namespace anchord::sql
