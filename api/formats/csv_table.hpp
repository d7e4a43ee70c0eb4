#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "api/formats/csv_record.hpp"
#include "api/formats/gzip_lines.hpp"
#include "core/base/result.hpp"

namespace anchord {

/// Reads a comma-separated file, plain or gzip, line by line: a header of names, then rows, as CsvRecord has
/// them; a record is one line. UTF-8 byte-order mark and CRLF are taken in stride; empty lines are skipped.
/// Memory: one line.
class CsvTable {
 public:
  /// Opens `folder/stem.csv` or `folder/stem.csv.gz`. errors: not_found, invalid_argument (no header, both
  /// exist)
  static Result<CsvTable> open(const std::filesystem::path& folder, const std::string& stem);
  const std::vector<std::string>& header() const { return header_; }
  std::optional<std::size_t> column(std::string_view name) const;
  /// Column that must be there; the error names the file and what it has.
  Result<std::size_t> require(std::string_view name) const;

  /// Moves to the next row: false at the end. errors: wrong number of fields, those of CsvRecord and
  /// GzipLines
  Result<bool> next();
  std::string_view text(std::size_t column) const { return record_.cells()[column]; }
  /// Number of a field; "nan" and "inf" are numbers here, their judge is the solver. Error names file, line,
  /// column.
  Result<double> number(std::size_t column) const;
  /// Nothing for an absent column or an empty field.
  Result<std::optional<double>> number(const std::optional<std::size_t>& column) const;
  Error error(std::string_view text) const;  ///< with file and line in front
  std::size_t line() const { return lines_.line_number(); }

 private:
  CsvTable(std::string file, api::GzipLines lines) : file_(std::move(file)), lines_(std::move(lines)) {}
  Result<bool> read_record();
  std::string file_;
  api::GzipLines lines_;
  api::CsvRecord record_;
  std::vector<std::string> header_;
};

}  // namespace anchord
