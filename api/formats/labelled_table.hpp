#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/nlos/features.hpp"

/// Labelled measurements as people publish them: CSV, one ranging a line, columns found by name
/// (docs/learning.md lists the names).
namespace anchord::api {

struct TableOptions {
  std::string label{};      ///< column; empty: nlos, is_nlos, los, label, cls, class
  std::string los_value{};  ///< what means LOS there; empty: as the name of the column or the words say
  std::string range{};      ///< column of the measured range; empty: range_m and its kin
  std::string truth{};      ///< column of the true range; empty: true_range_m and its kin
  std::vector<std::string> group_by{};         ///< columns naming a place; empty: env, setup, tag_pos, ...
  std::vector<std::string> placement{};        ///< columns naming one placement; empty: setup_id, ...
  std::optional<std::filesystem::path> cir{};  ///< table of |taps| m0.. with join columns (setup, idx)
};

/// Reason -> how many rows were left out, and where the first of them stands ("rooms.csv:17").
using Dropped = std::map<std::string, std::pair<std::size_t, std::string>>;

/// How the rows were told apart for splits.
enum class Grouping { column, file, time_block, row };

struct LabelledTable {
  std::vector<nlos::FeatureVector> features{};
  std::vector<std::string> raw_names{};  ///< numeric columns as they stand
  std::vector<double> raw{};             ///< rows x raw_names; NaN where the cell is no finite number
  std::vector<std::optional<bool>> los{};
  std::vector<std::optional<double>> true_range_m{};
  std::vector<double> range_m{};  ///< 0 throughout where the table has no ranges, only levels
  std::vector<std::uint32_t> group{}, placement{};
  std::vector<std::string> group_names{};
  std::string los_value{};  ///< of the label column: what was taken for LOS
  std::string label_column{}, truth_column{}, group_by{}, placement_by{};
  Grouping grouping{Grouping::row};
  std::size_t rows_read{};
  Dropped dropped{};
  std::vector<std::string>
      unused{};  ///< columns of the first file that are no one's role: features by name alone
  std::vector<std::string> warnings{};        ///< what is odd about columns, times and names
  std::vector<std::uint32_t> file{}, line{};  ///< where each row stands; empty where the rows are of no file
  std::vector<std::string> file_names{};
  std::vector<std::string> placement_names{};  ///< within their place: two places may use a name twice

  std::string where(std::size_t row) const;  ///< "file:line"
  std::size_t rows() const { return range_m.size(); }
  bool labelled() const { return !label_column.empty(); }
  bool has_truth() const { return !truth_column.empty(); }
};

/// errors: not_found (file, column), bad_frame (a line with another number of cells: file and line named),
/// invalid_argument
Result<LabelledTable> read_labelled_tables(std::span<const std::filesystem::path> paths,
                                           const TableOptions& options);

}  // namespace anchord::api
