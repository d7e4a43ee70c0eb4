#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/learning/freeze.hpp"
#include "api/learning/learning_json.hpp"
#include "api/learning/routes.hpp"
#include "api/learning/rule_rows.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

DatasetRecord find_dataset(LearningStores& stores, const std::string& text) {
  if (const auto id = parse_uuid(text))
    return value_or_problem(stores.datasets.dataset(DatasetId{id.value()}));
  return value_or_problem(stores.datasets.dataset(text));
}

namespace {

constexpr std::uint64_t k_max_csv_bytes = 32ULL << 20;

DatasetRecord named_dataset(LearningApi& l, const Request& request) {
  return find_dataset(l.stores, request.params.at("id"));
}

Response list_datasets(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<DatasetId>(
      request,
      [&](std::size_t limit, const std::optional<DatasetId>& after) {
        return l.stores.datasets.datasets(limit, after);
      },
      [&](const auto& one) { return dataset_json(one, false); });
}

/// The rows come with the request: what GET .../rows gave elsewhere.
FrozenDataset read_csv(const Request& request) {
  auto table = DatasetTable::parse(text_body(request));
  if (!table)
    throw_problem(422, "validation", table.error().message, {{"", "bad_csv", table.error().message}});
  return frozen_before(std::move(table).value());
}

Response create_dataset(LearningApi& l, const Request& request) {
  DatasetRecord record;
  FrozenDataset frozen;
  std::string_view type = request.header("content-type");
  type = type.substr(0, type.find(';'));
  if (type == "text/csv") {
    check_query(request, {"name"});
    record.name = request.query_value("name").value_or("");
    if (record.name.empty() || record.name.size() > 200)
      throw_problem(422, "validation", "name is missing", {{"/name", "required", "give ?name="}});
    record.query = {R"({"imported":true})"};
    frozen = read_csv(request);
  } else {
    check_query(request, {});
    std::vector<FieldError> errors;
    const auto query = read_dataset_query(json_body(request), l.stores.campaigns, l.missions, errors);
    refuse_if_any(errors);
    record.name = query.name;
    record.query = {query.json};
    auto made = freeze(query, l.stores.campaigns, l.measurements, l.missions, l.exclusions);
    if (!made && (made.error().code == Errc::too_few_observations || made.error().code == Errc::not_found ||
                  made.error().code == Errc::invalid_argument))
      throw_problem(422, "validation", made.error().message, {{"", "no_rows", made.error().message}});
    frozen = value_or_problem(std::move(made));
  }
  const std::string csv = frozen.table.csv();
  record.digest = dataset_digest(csv);
  record.report = {std::move(frozen.report_json)};
  record.n_train = frozen.n_train;
  record.n_test = frozen.n_test;
  record.created = l.clock.now();
  record.id.uuid = make_uuid_v7(record.created);
  record.created_by = request.principal.name;
  value_or_problem(l.stores.datasets.insert(record, csv));
  l.audit(request, "dataset.create " + to_string(record.id) + " " + record.digest);
  Response response = json_response(201, dataset_json(record, true));
  response.header("Location", "/api/v1/datasets/" + to_string(record.id));
  return response;
}

Ordered row_json(const DatasetTable& table, std::size_t index) {
  const auto& row = table.rows[index];
  Ordered registers = Ordered::object();
  for (std::size_t c = 0; c < row.registers.size(); ++c)
    if (!std::isnan(row.registers[c])) registers[table.registers[c]] = row.registers[c];
  return {{"row", index},
          {"campaign", row.campaign},
          {"environment", row.environment},
          {"setting", row.setting},
          {"split", row.test ? "test" : "train"},
          {"los", row.los ? Ordered(*row.los) : Ordered(nullptr)},
          {"true_range_m", row.true_range_m ? Ordered(*row.true_range_m) : Ordered(nullptr)},
          {"repeats", row.repeats},
          {"features", features_json(row.features)},
          {"registers", std::move(registers)}};
}

Response rows(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "format"});
  const auto record = named_dataset(l, request);
  auto csv = value_or_problem(l.stores.datasets.csv(record.id));
  const std::string format = negotiate(request, {"json", "csv", "ndjson"});
  Response response;
  if (format == "csv") {
    response.header("Content-Type", "text/csv; charset=utf-8");
    response.header("ETag", "\"" + record.digest + "\"");
    response.body = std::move(csv);
    return response;
  }
  const auto table = value_or_problem(DatasetTable::parse(csv));
  if (format == "ndjson") {
    response.header("Content-Type", "application/x-ndjson");
    for (std::size_t i = 0; i < table.rows.size(); ++i) response.body += to_wire(row_json(table, i)) + '\n';
    return response;
  }
  const auto page = page_query(request, 10'000);
  std::size_t from = 0;
  std::from_chars(page.cursor.data(), page.cursor.data() + page.cursor.size(), from);
  Ordered items = Ordered::array();
  std::size_t i = from;
  for (; i < table.rows.size() && i - from < page.limit; ++i) items.push_back(row_json(table, i));
  return list_response(request, std::move(items), i < table.rows.size() ? std::to_string(i) : "");
}

/// Tables 5.2 and 5.3 for this data set.
Response rules(LearningApi& l, const Request& request) {
  check_query(request, {"group_by", "seed"});
  const auto record = named_dataset(l, request);
  std::uint64_t seed = 1;
  if (const auto text = request.query_value("seed")) {
    const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), seed);
    if (error != std::errc{} || end != text->data() + text->size())
      throw_problem(422, "validation", "seed must be a whole number",
                    {{"/seed", "bad_value", "must be a whole number"}});
  }
  const auto group_by = query_word(request, "group_by", k_place_words).value_or(Place::environment);
  const auto table =
      value_or_problem(DatasetTable::parse(value_or_problem(l.stores.datasets.csv(record.id))));
  auto report = value_or_problem(rules_of(table, record.name, group_by, seed));
  const auto all = Ordered::parse(rules_json({report}));
  Ordered json = all.at("data_sets").at(0);
  json.erase("data_set");
  json["dataset"] = to_string(record.id);
  json["positive"] = "los";
  return json_response(200, json);
}

}  // namespace

void add_dataset_routes(Router& router, LearningApi& l) {
  const auto on = [&l](auto function) {
    return [&l, function](const Request& request) { return function(l, request); };
  };
  const auto engineer = Access::any_of({Role::engineer});
  router.add({Method::get, "/api/v1/datasets", readers(), on(list_datasets)});
  router.add(as_heavy({Method::post, "/api/v1/datasets", engineer, on(create_dataset), k_max_csv_bytes}));
  router.add({Method::get, "/api/v1/datasets/{id}", readers(), [&l](const Request& request) {
                check_query(request, {});
                const auto record = named_dataset(l, request);
                Response response = json_response(200, dataset_json(record, true));
                response.header("ETag", "\"" + record.digest + "\"");
                return response;
              }});
  router.add({Method::del, "/api/v1/datasets/{id}", engineer, [&l](const Request& request) {
                const auto record = named_dataset(l, request);
                value_or_problem(l.stores.datasets.remove(record.id));
                l.audit(request, "dataset.delete " + to_string(record.id) + " " + record.digest);
                Response response;
                response.status = 204;
                return response;
              }});
  router.add(as_heavy({Method::get, "/api/v1/datasets/{id}/rows", readers(), on(rows)}));
  router.add(as_heavy({Method::get, "/api/v1/datasets/{id}/rules", readers(), on(rules)}));
}

}  // namespace anchord::api
