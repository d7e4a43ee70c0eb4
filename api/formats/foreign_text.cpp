#include "api/formats/foreign_text.hpp"

#include <algorithm>
#include <vector>

#include "api/formats/cells.hpp"
#include "api/formats/foreign_values.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_looked_at = 2000;

/// The first line that is neither empty nor a comment.
std::string_view first_line(std::string_view text) {
  while (!text.empty()) {
    const auto line = text.substr(0, text.find('\n'));
    if (!line.starts_with('#') && line.find_first_not_of(" \t\r") != std::string_view::npos) return line;
    text.remove_prefix(std::min(text.size(), line.size() + 1));
  }
  return {};
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> out;
  while (!line.empty()) {
    const auto end = line.find_first_of(",;|\t\r ");
    if (end != 0) out.push_back(line.substr(0, end));
    line.remove_prefix(end == std::string_view::npos ? line.size() : end + 1);
  }
  return out;
}

/// A number, a date or a time of day.
bool is_value(std::string_view word) {
  return word.find_first_of("0123456789") != std::string_view::npos &&
         word.find_first_not_of("0123456789.:/+-") == std::string_view::npos;
}

}  // namespace

std::string no_table(std::string_view text) {
  const auto line = first_line(text);
  if (line.starts_with('<')) {
    const auto head = lower_case(text.substr(0, k_looked_at));
    if (contains(head, "<gpx"))
      return "GPX is no table: write its points as CSV with time, lat, lon and alt, or give the log of the "
             "receiver itself (NMEA, UBX, .pos)";
    if (contains(head, "<kml"))
      return "KML is no table: anchord plan import reads plans of it; write the points of a track as CSV "
             "with time, lat, lon and alt";
    return "XML is no table: write it as CSV with a header line of names";
  }
  if (line.starts_with('{') || line.starts_with('['))
    return "JSON is no table: write it as CSV with a header line of names; anchord decode FILE > track.csv "
           "reads JSON of gpsd";
  if (line.starts_with('$'))
    return "a log of NMEA is no table: the command line reads it as --track, and anchord decode FILE > "
           "track.csv makes one of it";
  const auto words = words_of(line);
  const auto n_values = std::ranges::count_if(words, is_value);
  if (words.size() > 1 && is_value(words.front()) && 2 * static_cast<std::size_t>(n_values) >= words.size())
    return "the first line has numbers; a header line with names is needed: write one above it, or let "
           "anchord decode FILE > track.csv read it where it has lines of LLH (Emlid, RTKLIB)";
  return "";
}

char take_separator_line(std::string_view& text) {
  const auto end = text.find('\n');
  const char separator = separator_named_by(text.substr(0, end));
  if (separator != '\0') text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return separator;
}

}  // namespace anchord::api
