#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_plan_insert =
    "INSERT INTO plan (id, name, site_id, document_json, created_t_ns, changed_t_ns, version) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7) ON CONFLICT DO NOTHING RETURNING version";
constexpr const char* k_plan_update =
    "UPDATE plan SET name = ?2, site_id = ?3, document_json = ?4, created_t_ns = ?5, changed_t_ns = ?6, "
    "version = ?7 WHERE id = ?1 AND version = ?8 RETURNING version";
constexpr const char* k_plan_columns =
    "SELECT id, name, site_id, document_json, created_t_ns, changed_t_ns, version FROM plan ";
constexpr const char* k_plan_remove = "DELETE FROM plan WHERE id = ?1 AND version = ?2 RETURNING version";
constexpr const char* k_exists = "SELECT version FROM plan WHERE id = ?1";
constexpr const char* k_plan_keep =
    "INSERT INTO mission_procedure (mission_key, state_json, changed_t_ns) VALUES (?1, ?2, ?3) "
    "ON CONFLICT (mission_key) DO UPDATE SET state_json = excluded.state_json, "
    "changed_t_ns = excluded.changed_t_ns";
constexpr const char* k_plan_forget = "DELETE FROM mission_procedure WHERE mission_key = ?1";
constexpr const char* k_plan_procedure =
    "SELECT p.state_json FROM mission_procedure p JOIN mission m ON m.mission_key = p.mission_key "
    "WHERE m.id = ?1";
constexpr const char* k_procedures =
    "SELECT m.id, p.state_json FROM mission_procedure p JOIN mission m ON m.mission_key = p.mission_key "
    "ORDER BY m.id";

/// Why a change of one version touched no row.
Error unchanged(Connection& c, const PlanId& id, std::uint64_t expected) {
  Query query(c, k_exists);
  query << id;
  if (!query.step()) return absent("plan", id);
  return moved_on("plan " + to_string(id), expected, query.as<std::uint64_t>());
}

void bind(Query& query, const StoredPlan& p, std::uint64_t version) {
  query << p.id << p.name << p.site << p.document << p.created << p.changed << version;
}

StoredPlan read_plan(Query& query) {
  StoredPlan p;
  p.id = query.id<PlanId>();
  p.name = query.text();
  p.site = query.maybe([&] { return query.id<SiteId>(); });
  p.document = query.document();
  p.created = query.time();
  p.changed = query.time();
  p.version = query.as<std::uint64_t>();
  return p;
}

class SqlPlanStore final : public PlanStore {
 public:
  explicit SqlPlanStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const StoredPlan& plan) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = missing_site(c, plan.site)) return error;
      Query query(c, k_plan_insert);
      bind(query, plan, plan.version);
      if (query.returned()) return std::nullopt;
      return make_error(Errc::conflict, "plan " + to_string(plan.id) + " exists");
    });
  }

  Result<void> update(const StoredPlan& plan, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto error = missing_site(c, plan.site)) return error;
      Query query(c, k_plan_update);
      bind(query, plan, expected_version + 1);
      query << expected_version;
      if (query.returned()) return std::nullopt;
      return unchanged(c, plan.id, expected_version);
    });
  }

  Result<StoredPlan> plan(const PlanId& id) override {
    return read_value<StoredPlan>(gate_, [&](Connection& c) -> Result<StoredPlan> {
      static const std::string text = std::string(k_plan_columns) + "WHERE id = ?1";
      Query query(c, text);
      query << id;
      if (!query.step()) return absent("plan", id);
      return read_plan(query);
    });
  }

  Result<std::vector<StoredPlan>> plans(std::size_t limit, const std::optional<PlanId>& after) override {
    return read_value<std::vector<StoredPlan>>(gate_, [&](Connection& c) -> Result<std::vector<StoredPlan>> {
      static const std::string first = std::string(k_plan_columns) + "ORDER BY id DESC LIMIT ?1";
      static const std::string next = std::string(k_plan_columns) + "WHERE id < ?1 ORDER BY id DESC LIMIT ?2";
      Query query(c, after ? next : first);
      if (after) query << *after;
      query << row_limit(limit);
      std::vector<StoredPlan> found;
      while (query.step()) found.push_back(read_plan(query));
      return found;
    });
  }

  Result<void> remove(const PlanId& id, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_plan_remove);
      query << id << expected_version;
      if (query.returned()) return std::nullopt;
      return unchanged(c, id, expected_version);
    });
  }

  Result<void> keep_procedure(const MissionId& mission, std::string_view state_json, UtcTime now) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      Query query(c, state_json.empty() ? k_plan_forget : k_plan_keep);
      query << *key;
      if (!state_json.empty()) query << state_json << now;
      query.run();
      return std::nullopt;
    });
  }

  Result<std::vector<std::pair<MissionId, std::string>>> procedures() override {
    using Rows = std::vector<std::pair<MissionId, std::string>>;
    return read_value<Rows>(gate_, [&](Connection& c) -> Result<Rows> {
      Query query(c, k_procedures);
      Rows rows;
      while (query.step()) {
        const auto id = query.id<MissionId>();
        rows.emplace_back(id, query.text());
      }
      return rows;
    });
  }

  Result<std::string> procedure(const MissionId& mission) override {
    return read_value<std::string>(gate_, [&](Connection& c) -> Result<std::string> {
      Query query(c, k_plan_procedure);
      query << mission;
      return query.step() ? query.text() : std::string{};
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<PlanStore> make_plan_store(Gate& gate) { return std::make_unique<SqlPlanStore>(gate); }

}  // namespace anchord::sql
