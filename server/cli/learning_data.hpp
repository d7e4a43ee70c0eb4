#pragma once

#include <string>
#include <vector>

#include "api/formats/labelled_table.hpp"
#include "api/learning/dataset_table.hpp"
#include "api/learning/learning_report.hpp"

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
/// Columns that are features are used.
void take_features(api::RowReport& report, const std::vector<std::string>& features);
/// Adds the reasons a data set gave for leaving rows out.
void add_dropped(api::RowReport& report, const api::Dropped& dropped);

/// A frozen data set, of `anchord dataset build` or of the service, and its digest.
struct FrozenFile {
  api::DatasetTable table{};
  std::string digest{};
};
/// The whole text of a file, plain or gzipped. errors: not_found, bad_frame (damaged gzip)
Result<std::string> whole_text(const std::string& path);
/// Where the one file named is a frozen data set; else nothing. errors: those of DatasetTable::parse, with
/// the file's name
Result<std::optional<FrozenFile>> read_frozen(const DataOptions& options);

struct FrozenRows {
  ml::Dataset data{};
  api::RowReport report{};
  std::vector<std::string> held_out{};  ///< the data set's own test places
  std::string group_by{}, digest{}, not_for_live{}, feature_set{};
};
/// What a task needs of a frozen data set, as the service takes it: nothing is computed or dropped again.
Result<FrozenRows> rows_for(const DataOptions& options, const FrozenFile& file, ml::Task task,
                            const std::vector<std::string>& features);

/// A model artifact, refused by its size before it is read. errors: not_found, those of read_model_artifact,
/// with the file's name
Result<ml::Model> read_model_file(const std::string& path);

/// "x: message" on stderr; the exit code.
int refuse(const char* command, const std::string& message);

}  // namespace anchord::cli
