#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/formats/bundle_manifest.hpp"
#include "api/formats/zip_archive.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/bundle.hpp"

/// The flight bundle (docs/formats.md): a zip file with a manifest, one file of lines for each table, and
/// notes. A line is a JSON array; the first of a table names its columns.
namespace anchord::api {

std::string bundle_entry_name(const BundleTable& table);
/// Columns of the entry of a table whose first row is this (none: null): without those that came later and
/// have no value.
std::size_t bundle_width(const BundleTable& table, const BundleRow* first);
/// Of the first n columns, with their line end.
std::string bundle_header(const BundleTable& table, std::size_t n_columns);
std::string bundle_line(const BundleTable& table, const BundleRow& row, std::size_t n_columns);
/// Columns of an entry, by its first line. errors: invalid_argument
Result<std::size_t> read_bundle_header(const BundleTable& table, std::string_view line);
/// A row of all columns, empty where the entry has none. errors: invalid_argument
Result<BundleRow> read_bundle_line(const BundleTable& table, std::string_view line, std::size_t n_columns);

/// Lines of an entry, one in memory. errors: those of the zip file; bad_frame where a line is too long
class ZipLines {
 public:
  static constexpr std::size_t k_line_bytes = std::size_t{128} << 20;
  static Result<ZipLines> open(const ZipReader& zip, std::string_view name);
  /// False at the end. The line holds until the next call.
  Result<bool> next(std::string_view& line);
  std::uint64_t number() const { return number_; }

 private:
  ZipLines(ZipReader::Stream stream, std::string name) : stream_(std::move(stream)), name_(std::move(name)) {}
  ZipReader::Stream stream_;
  std::string name_, buffer_;
  std::size_t at_{0};
  std::uint64_t number_{0};
  bool ended_{false};
};

}  // namespace anchord::api
