#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_kit_columns =
    "SELECT kit, version, t_ns, changed_by, source, profile_json FROM kit_profile ";
constexpr const char* k_newest_of = "WHERE kit = ?1 ORDER BY version DESC LIMIT ?2";
constexpr const char* k_newest_of_all =
    "AS p WHERE version = (SELECT max(version) FROM kit_profile WHERE kit = p.kit) ORDER BY kit";
constexpr const char* k_version = "SELECT coalesce(max(version), 0) FROM kit_profile WHERE kit = ?1";
constexpr const char* k_kit_insert =
    "INSERT INTO kit_profile (kit, version, t_ns, changed_by, source, profile_json) VALUES (?1, ?2, ?3, ?4, "
    "?5, ?6)";

StoredProfile read_kit(Query& query) {
  StoredProfile p;
  p.kit = query.text();
  p.version = query.as<std::uint64_t>();
  p.time = query.time();
  p.by = query.text();
  p.source = query.text();
  p.profile = query.document();
  return p;
}

std::vector<StoredProfile> all_profiles(Query& query) {
  std::vector<StoredProfile> found;
  while (query.step()) found.push_back(read_kit(query));
  return found;
}

class SqlKitStore final : public KitStore {
 public:
  explicit SqlKitStore(Gate& gate) : gate_(gate) {}

  Result<std::optional<StoredProfile>> profile(const std::string& kit) override {
    BOOST_OUTCOME_TRY(auto found, history(kit, 1));
    if (found.empty()) return std::optional<StoredProfile>{};
    return std::optional<StoredProfile>(std::move(found.front()));
  }
  Result<StoredProfile> put(StoredProfile profile, std::uint64_t expected_version) override {
    return write_value<StoredProfile>(gate_, 1, [&](Connection& c) -> Result<StoredProfile> {
      Query version(c, k_version);
      version << profile.kit;
      const std::uint64_t stored = version.step() ? version.as<std::uint64_t>() : 0;
      if (stored != expected_version)
        return moved_on("the profile of kit " + profile.kit, expected_version, stored);
      StoredProfile kept = profile;
      kept.version = stored + 1;
      Query insert(c, k_kit_insert);
      insert << kept.kit << kept.version << kept.time << kept.by << kept.source << kept.profile;
      insert.run();
      return kept;
    });
  }
  Result<std::vector<StoredProfile>> history(const std::string& kit, std::size_t limit) override {
    return read_value<std::vector<StoredProfile>>(gate_,
                                                  [&](Connection& c) -> Result<std::vector<StoredProfile>> {
                                                    Query query(c, std::string(k_kit_columns) + k_newest_of);
                                                    query << kit << row_limit(limit);
                                                    return all_profiles(query);
                                                  });
  }
  Result<std::vector<StoredProfile>> newest() override {
    return read_value<std::vector<StoredProfile>>(
        gate_, [&](Connection& c) -> Result<std::vector<StoredProfile>> {
          Query query(c, std::string(k_kit_columns) + k_newest_of_all);
          return all_profiles(query);
        });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<KitStore> make_kit_store(Gate& gate) { return std::make_unique<SqlKitStore>(gate); }

}  // namespace anchord::sql
