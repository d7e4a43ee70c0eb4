#include "core/ports/procedure_log.hpp"

#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_last_entry =
    "SELECT coalesce(max(number), 0) FROM procedure_log WHERE mission_key = ?1";
constexpr const char* k_insert_entry =
    "INSERT INTO procedure_log (mission_key, number, t_ns, topic, message_json) VALUES (?1, ?2, ?3, ?4, ?5)";
constexpr const char* k_procedure_log_entries =
    "SELECT number, t_ns, topic, message_json FROM procedure_log WHERE mission_key = ?1 AND number > ?2 "
    "ORDER BY number LIMIT ?3";

class SqlProcedureLog final : public ProcedureLog {
 public:
  explicit SqlProcedureLog(Gate& gate) : gate_(gate) {}

  Result<void> append(const MissionId& mission, std::span<const ProcedureEntry> entries) override {
    const auto error = gate_.write(entries.size(), [&](Connection& c) -> std::optional<Error> {
      const auto key = mission_key(c, mission);
      if (!key) return std::nullopt;
      Query last(c, k_last_entry);
      last << *key;
      auto number = last.step() ? last.integer() : 0;
      Query query(c, k_insert_entry);
      for (const auto& entry : entries) {
        query.again();
        query << *key << ++number << entry.time << entry.topic << entry.message_json;
        query.run();
      }
      return std::nullopt;
    });
    if (error) return *error;
    return boost::outcome_v2::success();
  }

  Result<std::vector<Numbered>> entries(const MissionId& mission, std::size_t limit,
                                        std::uint64_t after) override {
    return read_value<std::vector<Numbered>>(gate_, [&](Connection& c) -> Result<std::vector<Numbered>> {
      std::vector<Numbered> found;
      const auto key = mission_key(c, mission);
      if (!key) return found;
      Query query(c, k_procedure_log_entries);
      query << *key << after << row_limit(limit);
      for (std::size_t bytes = 0; bytes < k_page_bytes && query.step();) {
        Numbered one;
        one.number = query.as<std::uint64_t>();
        one.entry.time = query.time();
        one.entry.topic = query.text();
        one.entry.message_json = query.text();
        bytes += one.entry.message_json.size();
        found.push_back(std::move(one));
      }
      return found;
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<ProcedureLog> make_procedure_log(Gate& gate) {
  return std::make_unique<SqlProcedureLog>(gate);
}

}  // namespace anchord::sql
