#include "api/formats/foreign_table.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "api/formats/csv_record.hpp"
#include "api/formats/foreign_text.hpp"
#include "api/formats/text_decoding.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_max_rows = 2'000'000, k_sample_rows = 200, k_guess_rows = 10;
constexpr std::size_t k_max_bytes = std::size_t{1} << 30;

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view take_line(std::string_view& text) {
  const auto end = text.find('\n');
  const auto line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line.ends_with('\r') ? line.substr(0, line.size() - 1) : line;
}

std::vector<std::string_view> words_of_line(std::string_view line) {
  std::vector<std::string_view> out;
  for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
    const auto end = std::find_if(line.begin(), line.end(), is_blank);
    out.push_back(line.substr(0, static_cast<std::size_t>(end - line.begin())));
    line.remove_prefix(out.back().size());
  }
  return out;
}

bool digits(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}
/// Digits, the mark, digits: a number with a fraction.
bool fraction(std::string_view text, char mark) {
  if (text.starts_with('+') || text.starts_with('-')) text.remove_prefix(1);
  const auto at = text.find(mark);
  return at != std::string_view::npos && digits(text.substr(0, at)) && digits(text.substr(at + 1));
}

/// The next record that is neither a comment nor empty; false at the end.
Result<bool> next_record(CsvRecord& record, std::string_view& text) {
  while (!text.empty()) {
    if (text.starts_with('#')) {
      take_line(text);
      continue;
    }
    BOOST_OUTCOME_TRY(const bool any, record.take(text));
    if (!any) return false;
    if (std::ranges::any_of(record.cells(), [](auto cell) { return !trimmed(cell).empty(); })) return true;
  }
  return false;
}

/// The separator by which the first lines have the same number of cells, and most of them.
char separator_of(std::string_view text) {
  char best = ',';
  double best_change = std::numeric_limits<double>::infinity(), most_cells = 0;
  for (const char separator : {',', ';', '\t', '|'}) {
    CsvRecord record({separator, true});
    std::string_view rest = text;
    std::vector<std::size_t> counts;
    while (counts.size() < k_guess_rows) {
      const auto more = next_record(record, rest);
      if (!more || !more.value()) break;
      counts.push_back(record.cells().size());
    }
    double change = 0, sum = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
      sum += static_cast<double>(counts[i]);
      if (i > 0) change += std::abs(static_cast<double>(counts[i]) - static_cast<double>(counts[i - 1]));
    }
    const double mean = counts.empty() ? 0 : sum / static_cast<double>(counts.size());
    if (change <= best_change && mean > most_cells && mean > 1.99) {
      best = separator;
      best_change = change;
      most_cells = mean;
    }
  }
  return best;
}

}  // namespace

Error ForeignTable::error(const std::string& what) const {
  return make_error(Errc::invalid_argument, name_ + what);
}

Result<ForeignTable> ForeignTable::read(const std::filesystem::path& file) {
  gzFile in = gzopen(file.c_str(), "rb");  // plain files come as they are
  if (in == nullptr) return make_error(Errc::not_found, file.string() + ": cannot be opened");
  std::string bytes;
  std::array<char, 65536> buffer{};
  int got = 0;
  while ((got = gzread(in, buffer.data(), static_cast<unsigned>(buffer.size()))) > 0 &&
         bytes.size() <= k_max_bytes)
    bytes.append(buffer.data(), static_cast<std::size_t>(got));
  const bool whole = gzclose_r(in) == Z_OK && got == 0;
  if (bytes.size() > k_max_bytes)
    return make_error(Errc::invalid_argument, file.string() + ": more than 1 GiB of text");
  if (!whole) return make_error(Errc::invalid_argument, file.string() + ": cannot be read completely");
  return parse(file.string(), bytes);
}

Result<ForeignTable> ForeignTable::parse(std::string name, std::string_view bytes) {
  ForeignTable table;
  table.name_ = std::move(name);
  table.text_ = std::make_unique<std::string>(decoded(bytes));
  if (const auto why = no_table(*table.text_); !why.empty()) return table.error(": " + why);
  BOOST_OUTCOME_TRYV(table.text_->starts_with('%') ? table.take_rtklib() : table.take_separated());
  if (table.cells_.empty()) return table.error(": a header line and at least one row are needed");
  const auto is_number = [&](const std::string& c) { return std::isfinite(table.number(c)); };
  if (std::ranges::all_of(table.columns_, is_number))
    return table.error(": the first line has numbers; a header line with names is needed");
  for (auto c = table.columns_.begin(); c != table.columns_.end(); ++c) {
    if (c->empty() || std::find(std::next(c), table.columns_.end(), *c) == table.columns_.end()) continue;
    return table.error(": two columns have the name \"" + *c + '"' +
                       (is_number(*c) ? ", which is a number; a header line with names is needed" : ""));
  }
  return table;
}

/// The last line of the heading has the names, blanks stand between columns, a moment is two words.
Result<void> ForeignTable::take_rtklib() {
  std::string_view text = *text_;
  std::vector<std::string_view> names;
  for (std::string_view rest = text; !rest.empty();) {
    const auto line = take_line(rest);
    if (!line.starts_with('%')) continue;
    names = words_of_line(line.substr(1));
    ellipsoidal_ = ellipsoidal_ || line.find("/ellipsoidal") != std::string_view::npos;
  }
  const bool known = !names.empty() && (names[0] == "GPST" || names[0] == "UTC" || names[0] == "JST");
  if (!known) return take_separated();
  if (std::ranges::any_of(names, [](auto n) { return n.find("(d'") != std::string_view::npos; }))
    return error(
        ": positions in degrees, minutes and seconds: write them in decimal degrees (out-outsolformat llh, "
        "out-degform deg)");
  columns_.assign(names.begin(), names.end());
  while (!text.empty()) {
    const auto line = take_line(text);
    auto words = line.starts_with('%') ? std::vector<std::string_view>{} : words_of_line(line);
    if (words.empty()) continue;
    if (words.size() > 1) {
      const char* const begin = words[0].data();
      words[1] = {begin, static_cast<std::size_t>(words[1].data() + words[1].size() - begin)};
      words.erase(words.begin());
    }
    BOOST_OUTCOME_TRYV(take_row(std::move(words)));
  }
  return boost::outcome_v2::success();
}

Result<void> ForeignTable::take_separated() {
  std::string_view text = *text_;
  const char said = take_separator_line(text);
  const char separator = said != '\0' ? said : separator_of(text);
  CsvRecord record({separator, true});
  const auto next = [&]() -> Result<bool> {
    auto more = next_record(record, text);
    if (!more)
      return error(" row " + std::to_string(columns_.empty() ? 1 : n_rows() + 2) + ": " +
                   more.error().message);
    return more;
  };
  BOOST_OUTCOME_TRY(const bool any, next());
  if (!any) return boost::outcome_v2::success();
  for (const auto cell : record.cells()) columns_.emplace_back(trimmed(cell));
  while (true) {
    BOOST_OUTCOME_TRY(const bool more, next());
    if (!more) break;
    auto cells = record.cells();
    // What was unescaped lives in the record until its next row.
    const auto within = [&](std::string_view c) {
      return c.data() >= text_->data() && c.data() <= text_->data() + text_->size();
    };
    for (auto& cell : cells)
      cell = trimmed(within(cell) ? cell : std::string_view(unescaped_.emplace_back(cell)));
    BOOST_OUTCOME_TRYV(take_row(std::move(cells)));
  }
  // A comma that separates columns is no decimal comma.
  if (separator == ',') return boost::outcome_v2::success();
  std::size_t commas = 0, points = 0;
  for (std::size_t i = 0; i < std::min(cells_.size(), k_sample_rows * columns_.size()); ++i) {
    commas += fraction(cells_[i], ',') ? 1 : 0;
    points += fraction(cells_[i], '.') ? 1 : 0;
  }
  decimal_comma_ = commas > points;
  return boost::outcome_v2::success();
}

Result<void> ForeignTable::take_row(std::vector<std::string_view> cells) {
  // Spreadsheets leave empty cells at the end of a row.
  while (cells.size() > columns_.size() && cells.back().empty()) cells.pop_back();
  const std::string row = " row " + std::to_string(n_rows() + 2);
  if (cells.size() != columns_.size())
    return error(row + ": " + std::to_string(cells.size()) + " cells, the header has " +
                 std::to_string(columns_.size()));
  if (n_rows() >= k_max_rows) return error(": more than " + std::to_string(k_max_rows) + " rows");
  cells_.insert(cells_.end(), cells.begin(), cells.end());
  return boost::outcome_v2::success();
}

std::optional<std::size_t> ForeignTable::column(std::string_view name) const {
  const auto at = std::ranges::find(columns_, name);
  if (name.empty() || at == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(at - columns_.begin());
}

double ForeignTable::number(std::string_view cell) const {
  std::array<char, 64> changed{};
  // Beside decimal commas a point stands between thousands: "12.345" is not 12.345.
  if (decimal_comma_ && cell.find('.') != std::string_view::npos)
    return std::numeric_limits<double>::quiet_NaN();
  if (decimal_comma_ && cell.size() < changed.size()) {
    std::ranges::copy(cell, changed.begin());
    const auto comma = cell.find(',');
    if (comma != std::string_view::npos) changed[comma] = '.';
    cell = {changed.data(), cell.size()};
  }
  if (cell.starts_with('+')) cell.remove_prefix(1);
  double value{};
  const auto [end, fault] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  return !cell.empty() && fault == std::errc{} && end == cell.data() + cell.size()
             ? value
             : std::numeric_limits<double>::quiet_NaN();
}

std::vector<std::string_view> ForeignTable::sample(std::string_view name) const {
  std::vector<std::string_view> out;
  const auto at = column(name);
  for (std::size_t row = 0; at && row < std::min(n_rows(), k_sample_rows); ++row)
    out.push_back(cell(row, *at));
  return out;
}

std::vector<double> ForeignTable::sample_numbers(std::string_view name) const {
  std::vector<double> out;
  for (const auto text : sample(name)) {
    if (const double value = number(text); std::isfinite(value)) out.push_back(value);
  }
  return out;
}

std::vector<std::string> ForeignTable::number_columns(std::span<const std::string> claimed) const {
  std::vector<std::string> out;
  for (const auto& name : columns_) {
    if (name.empty() || std::ranges::find(claimed, name) != claimed.end()) continue;
    auto cells = sample(name);
    std::erase_if(cells, [](auto cell) { return cell.empty(); });
    if (!cells.empty() && std::ranges::all_of(cells, [&](auto c) { return std::isfinite(number(c)); }))
      out.push_back(name);
  }
  return out;
}

ForeignTable ForeignTable::with_a_row_for_each_range(std::span<const std::string> anchors) && {
  ForeignTable out;
  std::vector<std::size_t> kept, of_anchors;
  for (std::size_t i = 0; i < columns_.size(); ++i)
    (std::ranges::find(anchors, columns_[i]) != anchors.end() ? of_anchors : kept).push_back(i);
  for (const auto i : kept) out.columns_.push_back(columns_[i]);
  out.columns_.insert(out.columns_.end(), {"anchor", "range"});
  std::vector<std::string_view> names;
  for (const auto i : of_anchors) names.emplace_back(unescaped_.emplace_back(columns_[i]));
  for (std::size_t row = 0; row < n_rows(); ++row) {
    for (std::size_t a = 0; a < of_anchors.size(); ++a) {
      const auto range = cell(row, of_anchors[a]);
      if (range.empty()) continue;
      for (const auto i : kept) out.cells_.push_back(cell(row, i));
      out.cells_.insert(out.cells_.end(), {names[a], range});
    }
  }
  out.name_ = std::move(name_);
  out.text_ = std::move(text_);
  out.unescaped_ = std::move(unescaped_);
  out.decimal_comma_ = decimal_comma_;
  out.ellipsoidal_ = ellipsoidal_;
  return out;
}

}  // namespace anchord::api
