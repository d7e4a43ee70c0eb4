#include "api/formats/csv_table.hpp"

#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "core/base/text.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_max_line_bytes = 64 * 1024;

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

void split(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  while (true) {
    const std::size_t comma = line.find(',');
    fields.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

gzFile handle(void* gz) { return static_cast<gzFile>(gz); }

}  // namespace

CsvTable::CsvTable(CsvTable&& other) noexcept
    : file_(std::move(other.file_)),
      gz_(std::exchange(other.gz_, nullptr)),
      line_(other.line_),
      header_(std::move(other.header_)) {}

CsvTable::~CsvTable() {
  if (gz_) gzclose(handle(gz_));
}

Result<CsvTable> CsvTable::open(const std::filesystem::path& folder, const std::string& stem) {
  std::error_code ignored;
  const auto plain = folder / (stem + ".csv");
  const auto packed = folder / (stem + ".csv.gz");
  const bool has_plain = std::filesystem::exists(plain, ignored);
  const bool has_packed = std::filesystem::exists(packed, ignored);
  if (!has_plain && !has_packed) {
    return make_error(Errc::not_found,
                      folder.string() + ": neither " + stem + ".csv nor " + stem + ".csv.gz is there");
  }
  if (has_plain && has_packed) {
    return make_error(Errc::invalid_argument, folder.string() + ": both " + stem + ".csv and " + stem +
                                                  ".csv.gz are there; which is meant?");
  }
  CsvTable table;
  table.file_ = (has_plain ? plain : packed).string();
  table.gz_ = gzopen(table.file_.c_str(), "rb");  // reads plain files as well
  if (!table.gz_) return make_error(Errc::not_found, table.file_ + ": cannot be opened");
  gzbuffer(handle(table.gz_), 128 * 1024);
  BOOST_OUTCOME_TRY(const bool any, table.read_line());
  if (!any) return make_error(Errc::invalid_argument, table.file_ + ": empty, expected a header line");
  std::string_view line = table.line_text_;
  if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
  std::vector<std::string_view> names;
  split(line, names);
  for (const auto name : names) {
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

Result<bool> CsvTable::read_line() {
  while (true) {
    line_text_.clear();
    char chunk[4096];
    while (true) {
      if (!gzgets(handle(gz_), chunk, sizeof chunk)) {
        int code = Z_OK;
        const char* why = gzerror(handle(gz_), &code);
        // A gzip cut off in the middle ends with Z_BUF_ERROR; Z_OK and Z_STREAM_END are an ordinary end.
        if (code != Z_OK && code != Z_STREAM_END) {
          ++line_;
          return error(std::string("damaged gzip: ") + why);
        }
        break;
      }
      line_text_ += chunk;
      if (line_text_.ends_with('\n')) break;
      if (line_text_.size() > k_max_line_bytes) {
        ++line_;
        return error("a line over 64 KiB");
      }
    }
    if (line_text_.empty()) return false;
    ++line_;
    while (line_text_.ends_with('\n') || line_text_.ends_with('\r')) line_text_.pop_back();
    if (!line_text_.empty()) return true;
  }
}

Result<bool> CsvTable::next() {
  BOOST_OUTCOME_TRY(const bool any, read_line());
  if (!any) return false;
  split(line_text_, fields_);
  if (fields_.size() != header_.size()) {
    return error(std::to_string(fields_.size()) + " fields, the header has " +
                 std::to_string(header_.size()));
  }
  return true;
}

Result<double> CsvTable::number(std::size_t column) const {
  std::string_view text = fields_[column];
  if (text.starts_with('+')) text.remove_prefix(1);
  double value{};
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || code != std::errc{} || end != text.data() + text.size()) {
    return error(header_[column] + ": '" + to_utf8(fields_[column], 40) + "' is not a number");
  }
  return value;
}

Result<std::optional<double>> CsvTable::number(const std::optional<std::size_t>& column) const {
  if (!column || fields_[*column].empty()) return std::optional<double>{};
  BOOST_OUTCOME_TRY(const double value, number(*column));
  return std::optional<double>{value};
}

Error CsvTable::error(std::string_view text) const {
  return make_error(Errc::invalid_argument, file_ + ":" + std::to_string(line_) + ": " + std::string(text));
}

}  // namespace anchord
