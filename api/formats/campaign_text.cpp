#include "api/formats/campaign_text.hpp"

#include <algorithm>
#include <array>

#include "api/formats/cells.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_numbers = 3;
constexpr std::array<std::string_view, k_numbers> k_units{"ms", "mm", "dbm"};
constexpr std::string_view k_what_to_do =
    ": a .txt line is time in ms, distance in mm and RSS in dBm; give anything else as CSV with a header "
    "(t_s or t_ms, range_m or range_mm, rx_dbm)";

/// The number a name announces.
std::optional<std::size_t> announced(std::string_view word) {
  constexpr std::array<std::string_view, 3> k_time{"timestamp", "time", "t"};
  constexpr std::array<std::string_view, 4> k_distance{"distance", "dist", "range", "d"};
  constexpr std::array<std::string_view, 5> k_level{"rss", "rssi", "rx", "level", "power"};
  if (std::ranges::find(k_time, word) != k_time.end()) return 0;
  if (std::ranges::find(k_distance, word) != k_distance.end()) return 1;
  if (std::ranges::find(k_level, word) != k_level.end()) return 2;
  return std::nullopt;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }
/// Letters of any alphabet: bytes of UTF-8 beyond ASCII are none of a number or a separator.
bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
         static_cast<unsigned char>(c) >= 0x80;
}
bool is_between(char c) { return std::string_view(" \t;,:=()[]\"'").find(c) != std::string_view::npos; }

std::string shown(std::string_view text) { return '"' + to_utf8(text, 40) + '"'; }

class LineReader {
 public:
  explicit LineReader(std::string_view line)
      : line_(line), commas_alone_(line.find_first_of(" \t;") == std::string_view::npos) {}

  CampaignLine run() {
    const auto commas = std::count(line_.begin(), line_.end(), ',');
    if (commas_alone_ && commas > 2) {
      out_.fault = std::to_string(commas + 1) +
                   " numbers separated by commas alone: with decimal commas, separate the numbers by "
                   "spaces or semicolons; else give only time in ms, distance in mm and RSS in dBm";
      return out_;
    }
    for (std::size_t i = 0; i < line_.size() && out_.fault.empty();) {
      if (is_between(line_[i]))
        ++i;
      else if (is_letter(line_[i]))
        i = take_word(i);
      else
        i = take_number(i);
    }
    if (out_.fault.empty() && n_ < 2) {
      out_.too_few = true;
      out_.fault = "needs a time in ms and a distance in mm";
    }
    return out_;
  }

 private:
  void fail(const std::string& what) { out_.fault = what + std::string(k_what_to_do); }

  std::size_t take_word(std::size_t i) {
    std::size_t end = i;
    while (end < line_.size() && (is_letter(line_[end]) || is_digit(line_[end]))) ++end;
    const auto word = lower_case(line_.substr(i, end - i));
    if (const auto number = announced(word)) {
      if (*number != n_) fail("the number " + shown(word) + " announces is not the " + ordinal(n_));
    } else if (const auto unit = std::ranges::find(k_units, word); unit != k_units.end()) {
      if (n_ == 0 || static_cast<std::size_t>(unit - k_units.begin()) != n_ - 1)
        fail(shown(word) + " is not the unit of the number before it");
    } else {
      fail(shown(line_.substr(i, end - i)) + " is not understood");
    }
    return end;
  }

  std::size_t take_number(std::size_t i) {
    std::size_t end = line_[i] == '-' || line_[i] == '+' ? i + 1 : i;
    const auto digit = [this](std::size_t at) { return at < line_.size() && is_digit(line_[at]); };
    while (digit(end) || (end < line_.size() && line_[end] == '.' && digit(end + 1)) ||
           (!commas_alone_ && end < line_.size() && line_[end] == ',' && digit(end + 1)))
      ++end;
    auto text = line_.substr(i, end - i);
    if (text.starts_with('+')) text.remove_prefix(1);
    const auto number = cell_number(text, true);
    if (!number) {
      out_.fault = "not a number in " + shown(line_);
      return line_.size();
    }
    if (n_ == k_numbers) {
      fail("more than three numbers");
      return line_.size();
    }
    if (n_ == 0) out_.t_ms = *number;
    if (n_ == 1) out_.distance_mm = *number;
    if (n_ == 2) out_.rss_dbm = *number;
    ++n_;
    return end;
  }

  static std::string ordinal(std::size_t n) {
    constexpr std::array<std::string_view, k_numbers> k_ordinals{"first", "second", "third"};
    return n < k_numbers ? std::string(k_ordinals[n]) : "next";
  }

  std::string_view line_;
  bool commas_alone_;
  std::size_t n_{0};
  CampaignLine out_;
};

}  // namespace

CampaignLine read_campaign_line(std::string_view line) { return LineReader(line).run(); }

bool is_campaign_line(std::string_view line) {
  for (std::size_t i = 0; i < line.size();) {
    if (!is_letter(line[i])) {
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < line.size() && (is_letter(line[end]) || is_digit(line[end]))) ++end;
    const auto word = lower_case(line.substr(i, end - i));
    if (!announced(word) && std::ranges::find(k_units, word) == k_units.end()) return false;
    i = end;
  }
  return line.find_first_of("0123456789") != std::string_view::npos;
}

}  // namespace anchord::api
