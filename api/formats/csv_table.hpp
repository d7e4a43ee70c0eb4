#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord {

/// Reads a comma-separated file, plain or gzip, line by line: a header of names, then rows. Quotes are not
/// part of the layout. UTF-8 byte-order mark and CRLF are taken in stride; empty lines are skipped. Memory:
/// one line.
class CsvTable {
 public:
  /// Opens `folder/stem.csv` or `folder/stem.csv.gz`. errors: not_found, invalid_argument (no header, both
  /// exist)
  static Result<CsvTable> open(const std::filesystem::path& folder, const std::string& stem);
  CsvTable(CsvTable&&) noexcept;
  CsvTable& operator=(CsvTable&&) = delete;
  ~CsvTable();

  const std::vector<std::string>& header() const { return header_; }
  std::optional<std::size_t> column(std::string_view name) const;
  /// Column that must be there; the error names the file and what it has.
  Result<std::size_t> require(std::string_view name) const;

  /// Moves to the next row: false at the end. errors: wrong number of fields, a line over 64 KiB, damaged
  /// gzip
  Result<bool> next();
  std::string_view text(std::size_t column) const { return fields_[column]; }
  /// Number of a field; "nan" and "inf" are numbers here, their judge is the solver. Error names file, line,
  /// column.
  Result<double> number(std::size_t column) const;
  /// Nothing for an absent column or an empty field.
  Result<std::optional<double>> number(const std::optional<std::size_t>& column) const;
  Error error(std::string_view text) const;  ///< with file and line in front
  std::size_t line() const { return line_; }

 private:
  CsvTable() = default;
  Result<bool> read_line();
  std::string file_;
  void* gz_{nullptr};
  std::size_t line_{0};
  std::string line_text_;
  std::vector<std::string> header_;
  std::vector<std::string_view> fields_;
};

}  // namespace anchord
