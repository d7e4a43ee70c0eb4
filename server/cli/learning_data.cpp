#include "server/cli/learning_data.hpp"

#include <CLI/CLI.hpp>
#include <cstdio>

namespace anchord::cli {

void add_data_options(CLI::App& command, DataOptions& o) {
  command
      .add_option("--data", o.files,
                  "CSV of one ranging a line, plain or gzipped; several files: each is a place")
      ->required();
  command.add_option("--cir", o.cir, "CSV of CIR magnitudes m0, m1, ... joined by setup, idx or seq");
  command.add_option("--label", o.table.label, "Column of the class (default: nlos, los, label, cls)");
  command.add_option("--los-value", o.table.los_value, "Value of that column that means LOS");
  command.add_option("--range", o.table.range, "Column of the measured range (default: range_m and its kin)");
  command.add_option("--truth", o.table.truth,
                     "Column of the true range (default: true_range_m and its kin)");
  command.add_option("--group-by", o.table.group_by, "Columns naming a place, which no split divides")
      ->delimiter(',');
  command.add_option("--placement", o.table.placement, "Columns naming one placement of the devices")
      ->delimiter(',');
}

Result<api::LabelledTable> read_data(const DataOptions& o) {
  std::vector<std::filesystem::path> paths(o.files.begin(), o.files.end());
  auto table = o.table;
  if (!o.cir.empty()) table.cir = o.cir;
  return api::read_labelled_tables(paths, table);
}

api::RowReport row_report(const DataOptions& o, const api::LabelledTable& table) {
  api::RowReport report{o.files,        table.rows_read,    table.rows(),
                        table.dropped,  table.label_column, table.truth_column,
                        table.group_by, table.placement_by, {}};
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

void add_dropped(api::RowReport& report, const std::map<std::string, std::size_t>& dropped) {
  for (const auto& [reason, count] : dropped) report.dropped[reason].first += count;
}

int refuse(const char* command, const std::string& message) {
  std::fprintf(stderr, "anchord %s: %s\n", command, message.c_str());
  return 2;
}

}  // namespace anchord::cli
