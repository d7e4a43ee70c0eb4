#include "api/formats/csv_table.hpp"

#include <algorithm>
#include <charconv>

#include "api/formats/cells.hpp"
#include "core/base/text.hpp"

namespace anchord {

Result<CsvTable> CsvTable::open(const std::filesystem::path& folder, const std::string& stem) {
  std::error_code ignored;
  const auto plain = folder / (stem + ".csv");
  const auto packed = folder / (stem + ".csv.gz");
  const bool has_plain = std::filesystem::exists(plain, ignored);
  const bool has_packed = std::filesystem::exists(packed, ignored);
  if (!has_plain && !has_packed) {
    return make_error(Errc::not_found,
                      folder.string() + ": neither " + stem + ".csv nor " + stem + ".csv.gz exists");
  }
  if (has_plain && has_packed) {
    return make_error(Errc::invalid_argument, folder.string() + ": both " + stem + ".csv and " + stem +
                                                  ".csv.gz exist: remove one of them");
  }
  const auto& file = has_plain ? plain : packed;
  BOOST_OUTCOME_TRY(auto lines, api::GzipLines::open(file));
  CsvTable table(file.string(), std::move(lines));
  BOOST_OUTCOME_TRY(bool any, table.read_record());
  // The line by which Excel is told the separator.
  if (any) {
    const auto& cells = table.record_.cells();
    const bool comma = cells.size() == 2 && cells[0] == "sep=" && cells[1].empty();
    if (const char named = comma ? ',' : api::separator_named_by(cells.front()); named != '\0') {
      table.record_ = api::CsvRecord({named, true});
      BOOST_OUTCOME_TRY(any, table.read_record());
    }
  }
  if (!any) return make_error(Errc::invalid_argument, table.file_ + ": empty, expected a header line");
  for (const auto name : table.record_.cells()) {
    if (std::ranges::find(table.header_, name) != table.header_.end()) {
      return table.error("column '" + std::string(name) + "' occurs twice");
    }
    table.header_.emplace_back(name);
  }
  return table;
}

std::optional<std::size_t> CsvTable::column(std::string_view name) const {
  const auto at = std::ranges::find(header_, name);
  if (at == header_.end()) return std::nullopt;
  return static_cast<std::size_t>(at - header_.begin());
}

Result<std::size_t> CsvTable::require(std::string_view name) const {
  if (const auto at = column(name)) return *at;
  std::string have;
  for (const auto& h : header_) have += (have.empty() ? "" : ", ") + h;
  return make_error(Errc::invalid_argument,
                    file_ + ":1: column '" + std::string(name) + "' is missing (have: " + have + ")");
}

Result<bool> CsvTable::read_record() {
  std::string_view text;
  do {
    BOOST_OUTCOME_TRY(const bool any, lines_.next(text));
    if (!any) return false;
    if (lines_.line_number() == 1 && text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  } while (text.empty());
  if (const auto read = record_.read(text); !read) return error(read.error().message);
  return true;
}

Result<bool> CsvTable::next() {
  BOOST_OUTCOME_TRY(const bool any, read_record());
  if (!any) return false;
  if (record_.cells().size() != header_.size()) {
    return error(std::to_string(record_.cells().size()) + " fields, the header has " +
                 std::to_string(header_.size()));
  }
  return true;
}

Result<double> CsvTable::number(std::size_t column) const {
  std::string_view text = record_.cells()[column];
  if (text.starts_with('+')) text.remove_prefix(1);
  double value{};
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || code != std::errc{} || end != text.data() + text.size()) {
    return error(header_[column] + ": '" + to_utf8(record_.cells()[column], 40) + "' is not a number");
  }
  return value;
}

Result<std::optional<double>> CsvTable::number(const std::optional<std::size_t>& column) const {
  if (!column || text(*column).empty()) return std::optional<double>{};
  BOOST_OUTCOME_TRY(const double value, number(*column));
  return std::optional<double>{value};
}

Error CsvTable::error(std::string_view text) const {
  return make_error(Errc::invalid_argument, file_ + ":" + std::to_string(line()) + ": " + std::string(text));
}

}  // namespace anchord
