#pragma once

#include <string>
#include <vector>

#include "api/exports/learning_report.hpp"
#include "api/imports/labelled_table.hpp"

namespace CLI {
class App;
}

namespace anchord::cli {

/// Options `train` and `evaluate` share: which files, and which columns mean what.
struct DataOptions {
  std::vector<std::string> files{};
  std::string cir{};
  api::TableOptions table{};
};

void add_data_options(CLI::App& command, DataOptions& options);
Result<api::LabelledTable> read_data(const DataOptions& options);
api::RowReport row_report(const DataOptions& options, const api::LabelledTable& table);
/// Adds the reasons a data set gave for leaving rows out.
void add_dropped(api::RowReport& report, const std::map<std::string, std::size_t>& dropped);

/// "x: message" on stderr; the exit code.
int refuse(const char* command, const std::string& message);

}  // namespace anchord::cli
