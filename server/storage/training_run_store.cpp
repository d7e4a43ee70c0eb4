#include "server/storage/model_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_training_run_insert =
    "INSERT INTO training_run (id, dataset_key, task, request_json, summary_json, created_t_ns, created_by) "
    "SELECT ?1, dataset_key, ?3, ?4, ?5, ?6, ?7 FROM dataset WHERE id = ?2 RETURNING run_key";
constexpr const char* k_training_run_columns =
    "SELECT r.id, d.id, r.task, r.request_json, r.summary_json, (SELECT m.id FROM model m WHERE m.run_key = "
    "r.run_key ORDER BY m.model_key DESC LIMIT 1), r.created_t_ns, r.created_by FROM training_run r JOIN "
    "dataset d ON d.dataset_key = r.dataset_key ";
constexpr const char* k_training_run_finish =
    "UPDATE training_run SET summary_json = ?2 WHERE id = ?1 RETURNING run_key";
constexpr const char* k_drop_parts = "DELETE FROM training_part WHERE run_key = ?1";
constexpr const char* k_insert_part = "INSERT INTO training_part (run_key, name, json) VALUES (?1, ?2, ?3)";
constexpr const char* k_training_run_part =
    "SELECT p.json FROM training_part p JOIN training_run r ON r.run_key = p.run_key WHERE r.id = ?1 AND "
    "p.name = ?2";
constexpr const char* k_training_run_remove = "DELETE FROM training_run WHERE id = ?1 RETURNING run_key";

Error no_run(const TrainingRunId& id) {
  return make_error(Errc::not_found, "no training run " + to_string(id));
}

TrainingRun read_training_run(Query& query) {
  TrainingRun r;
  r.id = query.id<TrainingRunId>();
  r.dataset = query.id<DatasetId>();
  r.task = query.text();
  r.request = query.document();
  r.summary = query.document();
  r.model = query.maybe([&] { return query.id<ModelId>(); });
  r.created = query.time();
  r.created_by = query.text();
  return r;
}

class SqlTrainingRunStore final : public TrainingRunStore {
 public:
  explicit SqlTrainingRunStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const TrainingRun& r) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_training_run_insert);
      query << r.id << r.dataset << r.task << r.request << r.summary << r.created << r.created_by;
      if (query.returned()) return std::nullopt;
      return make_error(Errc::not_found, "no data set " + to_string(r.dataset));
    });
  }

  Result<TrainingRun> run(const TrainingRunId& id) override {
    return read_value<TrainingRun>(gate_, [&](Connection& c) -> Result<TrainingRun> {
      Query query(c, std::string(k_training_run_columns) + "WHERE r.id = ?1");
      query << id;
      if (!query.step()) return no_run(id);
      return read_training_run(query);
    });
  }

  Result<std::vector<TrainingRun>> runs(std::size_t limit, const std::optional<TrainingRunId>& after,
                                        const std::optional<std::string>& task) override {
    return read_value<std::vector<TrainingRun>>(
        gate_, [&](Connection& c) -> Result<std::vector<TrainingRun>> {
          Query query(c, std::string(k_training_run_columns) +
                             "WHERE (?1 IS NULL OR r.id < ?1) AND (?2 IS NULL OR r.task = ?2) "
                             "ORDER BY r.id DESC LIMIT ?3");
          query << after << task << row_limit(limit);
          std::vector<TrainingRun> found;
          while (query.step()) found.push_back(read_training_run(query));
          return found;
        });
  }

  Result<void> finish(const TrainingRunId& id, const Document& summary,
                      const std::map<std::string, std::string>& parts, const StoredModel& model,
                      std::string_view artifact) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_training_run_finish);
      query << id << summary;
      const auto key = query.returned();
      if (!key) return no_run(id);
      Query drop(c, k_drop_parts);
      drop << *key;
      drop.run();
      Query insert(c, k_insert_part);
      for (const auto& [name, json] : parts) {
        insert.again();
        insert << *key << name << json;
        insert.run();
      }
      insert_model(c, model, artifact);
      return std::nullopt;
    });
  }

  Result<std::string> part(const TrainingRunId& id, std::string_view name) override {
    return read_value<std::string>(gate_, [&](Connection& c) -> Result<std::string> {
      Query query(c, k_training_run_part);
      query << id << name;
      if (!query.step())
        return make_error(Errc::not_found, "training run " + to_string(id) + " has no " + std::string(name));
      return query.text();
    });
  }

  Result<void> remove(const TrainingRunId& id) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_training_run_remove);
      query << id;
      if (query.returned()) return std::nullopt;
      return no_run(id);
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<TrainingRunStore> make_training_run_store(Gate& gate) {
  return std::make_unique<SqlTrainingRunStore>(gate);
}

}  // namespace anchord::sql
