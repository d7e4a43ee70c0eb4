#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_dataset_insert =
    "INSERT INTO dataset (id, name, query_json, report_json, digest, n_train, n_test, created_t_ns, "
    "created_by) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) RETURNING dataset_key";
constexpr const char* k_insert_content = "INSERT INTO dataset_content (dataset_key, csv) VALUES (?1, ?2)";
constexpr const char* k_dataset_named = "SELECT 1 FROM dataset WHERE name = ?1";
constexpr const char* k_dataset_columns =
    "SELECT id, name, query_json, report_json, digest, n_train, n_test, created_t_ns, created_by FROM "
    "dataset ";
constexpr const char* k_content =
    "SELECT csv FROM dataset_content c JOIN dataset d ON d.dataset_key = c.dataset_key WHERE d.id = ?1";
constexpr const char* k_runs =
    "SELECT count(*) FROM training_run r JOIN dataset d ON d.dataset_key = r.dataset_key WHERE d.id = ?1";
constexpr const char* k_dataset_remove = "DELETE FROM dataset WHERE id = ?1 RETURNING dataset_key";

Error no_dataset(const DatasetId& id) { return make_error(Errc::not_found, "no data set " + to_string(id)); }

DatasetRecord read_dataset(Query& query) {
  DatasetRecord d;
  d.id = query.id<DatasetId>();
  d.name = query.text();
  d.query = query.document();
  d.report = query.document();
  d.digest = query.text();
  d.n_train = query.as<std::uint64_t>();
  d.n_test = query.as<std::uint64_t>();
  d.created = query.time();
  d.created_by = query.text();
  return d;
}

class SqlDatasetStore final : public DatasetStore {
 public:
  explicit SqlDatasetStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const DatasetRecord& d, std::string_view csv) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query named(c, k_dataset_named);
      named << d.name;
      if (named.step()) return make_error(Errc::conflict, "there is a data set named " + d.name);
      Query query(c, k_dataset_insert);
      query << d.id << d.name << d.query << d.report << d.digest << d.n_train << d.n_test << d.created
            << d.created_by;
      const auto key = query.returned();
      Query content(c, k_insert_content);
      content << key << csv;
      content.run();
      return std::nullopt;
    });
  }

  Result<DatasetRecord> dataset(const DatasetId& id) override {
    return read_value<DatasetRecord>(gate_, [&](Connection& c) -> Result<DatasetRecord> {
      Query query(c, std::string(k_dataset_columns) + "WHERE id = ?1");
      query << id;
      if (!query.step()) return no_dataset(id);
      return read_dataset(query);
    });
  }

  Result<DatasetRecord> dataset(std::string_view name) override {
    return read_value<DatasetRecord>(gate_, [&](Connection& c) -> Result<DatasetRecord> {
      Query query(c, std::string(k_dataset_columns) + "WHERE name = ?1");
      query << name;
      if (!query.step()) return make_error(Errc::not_found, "no data set " + std::string(name));
      return read_dataset(query);
    });
  }

  Result<std::vector<DatasetRecord>> datasets(std::size_t limit,
                                              const std::optional<DatasetId>& after) override {
    return read_value<std::vector<DatasetRecord>>(
        gate_, [&](Connection& c) -> Result<std::vector<DatasetRecord>> {
          Query query(c, std::string(k_dataset_columns) + (after ? "WHERE id < ?1 ORDER BY id DESC LIMIT ?2"
                                                                 : "ORDER BY id DESC LIMIT ?1"));
          if (after) query << *after;
          query << row_limit(limit);
          std::vector<DatasetRecord> found;
          while (query.step()) found.push_back(read_dataset(query));
          return found;
        });
  }

  Result<std::string> csv(const DatasetId& id) override {
    return read_value<std::string>(gate_, [&](Connection& c) -> Result<std::string> {
      Query query(c, k_content);
      query << id;
      if (!query.step()) return no_dataset(id);
      return query.text();
    });
  }

  Result<void> remove(const DatasetId& id) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query runs(c, k_runs);
      runs << id;
      if (runs.step() && runs.integer() > 0)
        return make_error(Errc::conflict, "training runs have used this data set; remove them first");
      Query query(c, k_dataset_remove);
      query << id;
      if (query.returned()) return std::nullopt;
      return no_dataset(id);
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<DatasetStore> make_dataset_store(Gate& gate) {
  return std::make_unique<SqlDatasetStore>(gate);
}

}  // namespace anchord::sql
