#pragma once

#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::api {

/// A table as other programs write it: UTF-8, UTF-16 with its mark, else Windows-1252; comma, semicolon, tab
/// or | between columns; decimal commas; lines with # passed over; position files of RTKLIB. The rules are
/// those of Import a flight in the dashboard (web/src/views/start), held together by tests/data/import. All
/// in memory.
class ForeignTable {
 public:
  /// Plain or gzip. errors: not_found, those of parse()
  static Result<ForeignTable> read(const std::filesystem::path& file);
  /// errors  invalid_argument: what is wrong, and in which row, as a spreadsheet counts: the header is row 1
  static Result<ForeignTable> parse(std::string name, std::string_view bytes);

  const std::string& name() const { return name_; }
  const std::vector<std::string>& columns() const { return columns_; }
  std::size_t n_rows() const { return columns_.empty() ? 0 : cells_.size() / columns_.size(); }
  std::string_view cell(std::size_t row, std::size_t column) const {
    return cells_[row * columns_.size() + column];
  }
  std::optional<std::size_t> column(std::string_view name) const;
  bool decimal_comma() const { return decimal_comma_; }
  /// The file says that its heights are above the ellipsoid.
  bool ellipsoidal() const { return ellipsoidal_; }

  /// NaN where it is none; also for nothing at all.
  double number(std::string_view cell) const;
  /// The first values of a column, as they show what it is; nothing of a column that is not there.
  std::vector<std::string_view> sample(std::string_view column) const;
  std::vector<double> sample_numbers(std::string_view column) const;

  /// Columns of numbers that are not among those named: where a logger writes one for each anchor.
  std::vector<std::string> number_columns(std::span<const std::string> claimed) const;
  /// The same ranges with a row for each: `anchor` and `range` beside what the row has of everything else.
  ForeignTable with_a_row_for_each_range(std::span<const std::string> anchors) &&;

 private:
  Result<void> take_rtklib();
  Result<void> take_separated();
  Result<void> take_row(std::vector<std::string_view> cells);
  Error error(const std::string& what) const;

  std::string name_;
  std::vector<std::string> columns_;
  std::vector<std::string_view> cells_;  ///< row by row, into text_ and unescaped_
  std::unique_ptr<std::string> text_;    ///< stays where it is
  std::deque<std::string> unescaped_;
  bool decimal_comma_{false}, ellipsoidal_{false};
};

}  // namespace anchord::api
