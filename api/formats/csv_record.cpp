#include "api/formats/csv_record.hpp"

#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_shown = 40;

/// Takes the end of a line off; false where there is none.
bool take_line_end(std::string_view& text) {
  if (text.starts_with("\r\n")) {
    text.remove_prefix(2);
    return true;
  }
  if (text.starts_with('\n')) {
    text.remove_prefix(1);
    return true;
  }
  return false;
}

}  // namespace

/// `text` begins at the opening quote, and afterwards behind the closing one.
Result<std::string_view> CsvRecord::quoted(std::string_view& text) {
  const std::string_view whole = text.substr(1);
  std::size_t end = whole.find('"');
  bool doubled = false;
  while (end != std::string_view::npos && end + 1 < whole.size() && whole[end + 1] == '"') {
    doubled = true;
    end = whole.find('"', end + 2);
  }
  if (end == std::string_view::npos)
    return make_error(Errc::bad_frame, "a quote is not closed: " + to_utf8(text, k_most_shown));
  const std::string_view inside = whole.substr(0, end);
  text.remove_prefix(end + 2);
  if (!doubled) return inside;
  auto& plain = unescaped_.emplace_back();
  for (std::size_t i = 0; i < inside.size(); ++i) {
    plain += inside[i];
    if (inside[i] == '"') ++i;
  }
  return std::string_view(plain);
}

Result<bool> CsvRecord::take(std::string_view& text) {
  cells_.clear();
  unescaped_.clear();
  if (text.empty()) return false;
  while (true) {
    while (!text.empty() && blank(text.front())) text.remove_prefix(1);
    if (text.starts_with('"')) {
      BOOST_OUTCOME_TRY(const auto cell, quoted(text));
      cells_.push_back(cell);
      while (!text.empty() && blank(text.front())) text.remove_prefix(1);
    } else {
      std::size_t end = 0;
      while (end < text.size() && text[end] != form_.separator && text[end] != '\n') ++end;
      std::string_view cell = text.substr(0, end);
      text.remove_prefix(end);
      if ((text.empty() || text.front() == '\n') && cell.ends_with('\r')) cell.remove_suffix(1);
      while (!cell.empty() && blank(cell.back())) cell.remove_suffix(1);
      cells_.push_back(cell);
    }
    if (text.empty() || text == "\r") {
      text = {};
      return true;
    }
    if (take_line_end(text)) return true;
    if (text.front() != form_.separator)
      return make_error(Errc::bad_frame, "text after a closing quote: " + to_utf8(text, k_most_shown));
    text.remove_prefix(1);
    // A separator at the very end has an empty cell behind it.
    if (text.empty()) {
      cells_.push_back(text);
      return true;
    }
  }
}

Result<void> CsvRecord::read(std::string_view line) {
  std::string_view rest = line;
  BOOST_OUTCOME_TRY(const bool any, take(rest));
  if (!any) cells_.push_back(line);
  if (!rest.empty()) return make_error(Errc::bad_frame, "a line end inside a line");
  return boost::outcome_v2::success();
}

}  // namespace anchord::api
