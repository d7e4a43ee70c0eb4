#include "server/cli/learning_data.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "api/formats/gzip_lines.hpp"
#include "api/learning/model_artifact.hpp"
#include "core/base/text.hpp"

namespace anchord::cli {

void add_data_options(CLI::App& command, DataOptions& o) {
  command
      .add_option("--data", o.files,
                  "CSV of one range per line, plain or gzipped; with several files, each is a place")
      ->required();
  command.add_option("--cir", o.cir, "CSV of CIR magnitudes m0, m1, ... joined by setup, idx or seq");
  command.add_option("--label", o.table.label, "Column of the class (default: nlos, los, label, cls)");
  command.add_option(
      "--los-value", o.table.los_value,
      "Value of that column that means LOS, where its name does not say it (label, cls, class)");
  command.add_option("--range", o.table.range,
                     "Column of the measured range (default: range_m and similar names)");
  command.add_option("--truth", o.table.truth,
                     "Column of the true range (default: true_range_m and similar names)");
  command
      .add_option("--group-by", o.table.group_by,
                  "Columns that name a place; a place is never divided between training and test")
      ->delimiter(',');
  command.add_option("--placement", o.table.placement, "Columns that name one placement of the devices")
      ->delimiter(',');
}

Result<api::LabelledTable> read_data(const DataOptions& o) {
  std::vector<std::filesystem::path> paths(o.files.begin(), o.files.end());
  auto table = o.table;
  if (!o.cir.empty()) table.cir = o.cir;
  return api::read_labelled_tables(paths, table);
}

api::RowReport row_report(const DataOptions& o, const api::LabelledTable& table) {
  api::RowReport report{
      o.files,        table.rows_read,    table.rows(), table.dropped, table.label_column, table.truth_column,
      table.group_by, table.placement_by, {},           table.unused,  table.warnings,     table.los_value};
  if (table.grouping == api::Grouping::row)
    report.warning =
        table.placement_by.empty()
            ? "no column names a place: rows are split at random, and every figure is optimistic for a new "
              "building"
            : "no column names a place: placements are split, and figures are optimistic for a new building";
  if (table.grouping == api::Grouping::time_block)
    report.warning = "no column names a place: split into blocks of time";
  return report;
}

void take_features(api::RowReport& report, const std::vector<std::string>& features) {
  std::erase_if(report.unused, [&](const std::string& name) {
    return std::find(features.begin(), features.end(), name) != features.end();
  });
}

void add_dropped(api::RowReport& report, const api::Dropped& dropped) {
  for (const auto& [reason, entry] : dropped) {
    auto& all = report.dropped[reason];
    if (all.first == 0) all.second = entry.second;
    all.first += entry.first;
  }
}

Result<std::string> whole_text(const std::string& path) {
  BOOST_OUTCOME_TRY(auto lines, api::GzipLines::open(path));
  std::string out;
  for (std::string_view line;;) {
    BOOST_OUTCOME_TRY(const bool more, lines.next(line));
    if (!more) return out;
    out.append(line).push_back('\n');
  }
}

Result<std::optional<FrozenFile>> read_frozen(const DataOptions& o) {
  if (o.files.size() != 1) return std::optional<FrozenFile>{};
  const auto& path = o.files.front();
  {
    BOOST_OUTCOME_TRY(auto lines, api::GzipLines::open(path));
    std::string_view first;
    BOOST_OUTCOME_TRY(const bool any, lines.next(first));
    if (!any || !api::is_dataset_csv(first)) return std::optional<FrozenFile>{};
  }
  BOOST_OUTCOME_TRY(const auto text, whole_text(path));
  auto table = api::DatasetTable::parse(text);
  if (!table) return make_error(table.error().code, path + ": " + table.error().message);
  FrozenFile out{std::move(table).value(), {}};
  out.digest = api::dataset_digest(out.table.csv());
  return std::optional{std::move(out)};
}

Result<FrozenRows> rows_for(const DataOptions& o, const FrozenFile& file, ml::Task task,
                            const std::vector<std::string>& features) {
  auto wish = api::wish_of(task, file.table);
  wish.features = features;
  if (!o.table.group_by.empty()) {
    const auto place = o.table.group_by.size() == 1 ? api::place_of(o.table.group_by.front()) : std::nullopt;
    if (!place)
      return make_error(Errc::invalid_argument,
                        "--group-by of a frozen data set must be environment, campaign or setting");
    wish.group_by = *place;
  }
  auto rows = api::learning_rows(file.table, wish);
  if (!rows) return make_error(rows.error().code, o.files.front() + ": " + rows.error().message);
  FrozenRows out;
  out.data = std::move(rows.value().data);
  out.held_out = std::move(rows.value().held_out);
  out.group_by = api::place_word(wish.group_by);
  out.digest = file.digest;
  out.not_for_live = api::not_for_live(file.table);
  out.feature_set = file.table.feature_set;
  auto& report = out.report;
  report.files = o.files;
  report.read = file.table.rows.size();
  report.used = out.data.rows();
  for (const auto& [reason, n] : rows.value().dropped) report.dropped[reason].first = n;
  report.label = out.data.labelled() ? "los" : "";
  report.truth = out.data.has_truth() ? "true_range_m" : "";
  report.group_by = out.group_by;
  report.placement = "setting";
  return out;
}

int refuse(const char* command, const std::string& message) {
  std::fprintf(stderr, "anchord %s: %s\n", command, printable(message).c_str());
  return 2;
}

Result<ml::Model> read_model_file(const std::string& path) {
  std::error_code failed;
  const auto bytes = std::filesystem::file_size(path, failed);
  if (failed) return make_error(Errc::not_found, path + ": cannot be read");
  // Refused by its size before it is read: nothing hostile fills the memory.
  if (bytes > api::k_max_artifact_bytes)
    return make_error(Errc::bad_frame, path + ": larger than any model artifact can be");
  std::ifstream file(path, std::ios::binary);
  if (!file) return make_error(Errc::not_found, path + ": cannot be read");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  auto model = api::read_model_artifact(text);
  if (!model) return make_error(model.error().code, path + ": " + model.error().message);
  return model;
}

}  // namespace anchord::cli
