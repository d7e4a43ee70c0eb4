#include "server/storage/model_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_model_insert =
    "INSERT INTO model (id, run_key, task, method, sha256_hex, manifest_json, created_t_ns, created_by, "
    "signature) VALUES (?1, (SELECT run_key FROM training_run WHERE id = ?2), ?3, ?4, ?5, ?6, ?7, ?8, ?9) "
    "RETURNING model_key";
constexpr const char* k_insert_artifact = "INSERT INTO model_artifact (model_key, json) VALUES (?1, ?2)";
constexpr const char* k_model_columns =
    "SELECT m.id, r.id, m.task, m.method, m.sha256_hex, m.manifest_json, m.created_t_ns, m.created_by, "
    "m.signature FROM "
    "model m LEFT JOIN training_run r ON r.run_key = m.run_key ";
constexpr const char* k_artifact =
    "SELECT a.json FROM model_artifact a JOIN model m ON m.model_key = a.model_key WHERE m.id = ?1";
constexpr const char* k_sign = "UPDATE model SET signature = ?2 WHERE id = ?1 RETURNING model_key";
constexpr const char* k_promoted =
    "SELECT count(*) FROM model_promotion p JOIN model m ON m.model_key = p.model_key WHERE m.id = ?1";
constexpr const char* k_model_remove = "DELETE FROM model WHERE id = ?1 RETURNING model_key";
constexpr const char* k_promote =
    "INSERT INTO model_promotion (task, model_key, t_ns, promoted_by, reason, is_rollback) VALUES (?1, "
    "(SELECT model_key FROM model WHERE id = ?2), ?3, ?4, ?5, ?6) RETURNING number";
constexpr const char* k_model_newest = "SELECT coalesce(max(number), 0) FROM model_promotion";
constexpr const char* k_promotions =
    "SELECT p.number, p.task, m.id, p.t_ns, p.promoted_by, p.reason, p.is_rollback FROM model_promotion p "
    "LEFT JOIN model m ON m.model_key = p.model_key ";

Error no_model(const ModelId& id) { return make_error(Errc::not_found, "no model " + to_string(id)); }

StoredModel read_model(Query& query) {
  StoredModel m;
  m.id = query.id<ModelId>();
  m.run = query.maybe([&] { return query.id<TrainingRunId>(); });
  m.task = query.text();
  m.method = query.text();
  m.sha256_hex = query.text();
  m.manifest = query.document();
  m.created = query.time();
  m.created_by = query.text();
  m.signature = query.text();
  return m;
}

Promotion read_promotion(Query& query) {
  Promotion p;
  p.number = query.as<std::uint64_t>();
  p.task = query.text();
  p.model = query.maybe([&] { return query.id<ModelId>(); });
  p.time = query.time();
  p.by = query.text();
  p.reason = query.text();
  p.rollback = query.integer() != 0;
  return p;
}

class SqlModelStore final : public ModelStore {
 public:
  explicit SqlModelStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const StoredModel& model, std::string_view artifact) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      insert_model(c, model, artifact);
      return std::nullopt;
    });
  }

  Result<StoredModel> model(const ModelId& id) override {
    return read_value<StoredModel>(gate_, [&](Connection& c) -> Result<StoredModel> {
      Query query(c, std::string(k_model_columns) + "WHERE m.id = ?1");
      query << id;
      if (!query.step()) return no_model(id);
      return read_model(query);
    });
  }

  Result<std::vector<StoredModel>> models(std::size_t limit, const std::optional<ModelId>& after) override {
    return read_value<std::vector<StoredModel>>(
        gate_, [&](Connection& c) -> Result<std::vector<StoredModel>> {
          Query query(c, std::string(k_model_columns) + (after ? "WHERE m.id < ?1 ORDER BY m.id DESC LIMIT ?2"
                                                               : "ORDER BY m.id DESC LIMIT ?1"));
          if (after) query << *after;
          query << row_limit(limit);
          std::vector<StoredModel> found;
          while (query.step()) found.push_back(read_model(query));
          return found;
        });
  }

  Result<std::string> artifact(const ModelId& id) override {
    return read_value<std::string>(gate_, [&](Connection& c) -> Result<std::string> {
      Query query(c, k_artifact);
      query << id;
      if (!query.step()) return no_model(id);
      return query.text();
    });
  }

  Result<void> sign(const ModelId& id, std::string_view signature) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_sign);
      query << id << signature;
      if (query.returned()) return std::nullopt;
      return no_model(id);
    });
  }

  Result<void> remove(const ModelId& id) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query promoted(c, k_promoted);
      promoted << id;
      if (promoted.step() && promoted.integer() > 0)
        return make_error(Errc::conflict,
                          "model " + to_string(id) + " has been promoted and cannot be deleted");
      Query query(c, k_model_remove);
      query << id;
      if (query.returned()) return std::nullopt;
      return no_model(id);
    });
  }

  Result<Promotion> promote(const Promotion& promotion, std::optional<std::uint64_t> decided_on) override {
    return write_value<Promotion>(gate_, 1, [&](Connection& c) -> Result<Promotion> {
      Query newest(c, k_model_newest);
      const std::uint64_t before = newest.step() ? newest.as<std::uint64_t>() : 0;
      if (decided_on && *decided_on != before)
        return make_error(Errc::conflict, "promotion " + std::to_string(before) +
                                              " was made in the meantime: read the active models again");
      if (promotion.model) {
        Query known(c, "SELECT task FROM model WHERE id = ?1");
        known << *promotion.model;
        if (!known.step()) return no_model(*promotion.model);
        if (known.text() != promotion.task)
          return make_error(Errc::conflict,
                            "model " + to_string(*promotion.model) + " is not of task " + promotion.task);
      }
      if (promotion.model && !promotion.signature.empty()) {
        Query sign(c, k_sign);
        sign << *promotion.model << promotion.signature;
        sign.run();
      }
      Query query(c, k_promote);
      query << promotion.task << promotion.model << promotion.time << promotion.by << promotion.reason
            << promotion.rollback;
      Promotion stored = promotion;
      stored.number = static_cast<std::uint64_t>(query.returned().value());
      return stored;
    });
  }

  Result<std::vector<Promotion>> active() override {
    return list("WHERE p.number IN (SELECT max(number) FROM model_promotion GROUP BY task) ORDER BY p.task",
                "", 0);
  }

  Result<std::vector<Promotion>> promotions(std::string_view task, std::size_t limit) override {
    if (task.empty()) return list("ORDER BY p.number DESC LIMIT ?1", "", limit);
    return list("WHERE p.task = ?1 ORDER BY p.number DESC LIMIT ?2", task, limit);
  }

 private:
  Result<std::vector<Promotion>> list(const char* where, std::string_view task, std::size_t limit) {
    return read_value<std::vector<Promotion>>(gate_, [&](Connection& c) -> Result<std::vector<Promotion>> {
      Query query(c, std::string(k_promotions) + where);
      if (!task.empty()) query << task;
      if (limit > 0) query << row_limit(limit);
      std::vector<Promotion> found;
      while (query.step()) found.push_back(read_promotion(query));
      return found;
    });
  }

  Gate& gate_;
};

}  // namespace

void insert_model(Connection& connection, const StoredModel& m, std::string_view artifact) {
  Query query(connection, k_model_insert);
  query << m.id << m.run << m.task << m.method << m.sha256_hex << m.manifest << m.created << m.created_by
        << m.signature;
  const auto key = query.returned();
  Query content(connection, k_insert_artifact);
  content << key << artifact;
  content.run();
}

std::unique_ptr<ModelStore> make_model_store(Gate& gate) { return std::make_unique<SqlModelStore>(gate); }

}  // namespace anchord::sql
