#include "drivers/dwm1001/protocol.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace anchord::dwm1001 {
namespace {

constexpr std::string_view k_prompt = "dwm> ";
constexpr std::size_t k_position = 13, k_anchor = 20;
constexpr std::uint8_t k_status = 0x40, k_own_position = 0x41, k_of_anchor = 0x48, k_of_tag = 0x49;

bool digits(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

/// "-12.34": as the module writes them, with two decimals; anything else was cut or run into.
std::optional<double> two_decimals(std::string_view text) {
  const std::string_view whole = text.starts_with('-') ? text.substr(1) : text;
  const auto point = whole.find('.');
  if (point == std::string_view::npos || point > 5 || !digits(whole.substr(0, point)) ||
      whole.size() != point + 3 || !digits(whole.substr(point + 1)))
    return std::nullopt;
  double out = 0;
  std::from_chars(text.data(), text.data() + text.size(), out);
  return out;
}

/// "7.94,8.03,0.00" and, where asked for, ",53".
std::optional<Estimate> numbers(std::string_view text, bool with_quality) {
  Estimate out;
  for (double* to : {&out.x_m, &out.y_m, &out.z_m}) {
    const auto end = text.find(',');
    const bool last = to == &out.z_m && !with_quality;
    if ((end == std::string_view::npos) != last) return std::nullopt;
    const auto value = two_decimals(text.substr(0, end));
    if (!value) return std::nullopt;
    *to = *value;
    text.remove_prefix(last ? text.size() : end + 1);
  }
  if (!with_quality) return out;
  if (!digits(text) || text.size() > 3) return std::nullopt;
  std::from_chars(text.data(), text.data() + text.size(), out.quality);
  return out.quality <= 100 ? std::optional(out) : std::nullopt;
}

std::string_view without_prompt(std::string_view line) {
  while (line.starts_with(k_prompt)) line.remove_prefix(k_prompt.size());
  return line;
}

std::optional<Distance> distance_of(std::string_view word) {
  const auto close = word.find("]=");
  if (word.size() < 5 || word[4] != '[' || close == std::string_view::npos) return std::nullopt;
  Distance out;
  const auto [end, error] = std::from_chars(word.data(), word.data() + 4, out.anchor, 16);
  if (error != std::errc{} || end != word.data() + 4) return std::nullopt;
  const auto metres = two_decimals(word.substr(close + 2));
  if (!metres || *metres < 0 || !numbers(word.substr(5, close - 5), false)) return std::nullopt;
  out.distance_m = *metres;
  return out;
}

std::uint32_t little(std::string_view bytes, std::size_t at, std::size_t n) {
  std::uint32_t out = 0;
  for (std::size_t i = 0; i < n; ++i)
    out |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + i])) << 8 * i;
  return out;
}

}  // namespace

Result<std::optional<std::vector<Distance>>> parse_les(std::string_view line) {
  using Found = std::optional<std::vector<Distance>>;
  line = without_prompt(line);
  if (line.find("]=") == std::string_view::npos) return Found{};
  std::vector<Distance> out;
  while (!line.empty()) {
    const auto end = std::min(line.find(' '), line.size());
    const auto word = line.substr(0, end);
    line.remove_prefix(std::min(end + 1, line.size()));
    const bool engine =
        (word.starts_with("le_us=") && digits(word.substr(6))) ||
        (word.starts_with("est[") && word.ends_with(']') && numbers(word.substr(4, word.size() - 5), true));
    if (word.empty() || engine) continue;
    const auto distance = distance_of(word);
    if (!distance) return make_error(Errc::bad_frame, "a line that another ran into");
    if (std::ranges::find(out, distance->anchor, &Distance::anchor) != out.end())
      return make_error(Errc::bad_frame, "an anchor twice in one line");
    out.push_back(*distance);
  }
  return Found(std::move(out));
}

std::optional<Estimate> parse_lep(std::string_view line) {
  line = without_prompt(line);
  return line.starts_with("POS,") ? numbers(line.substr(4), true) : std::nullopt;
}

std::optional<std::uint64_t> node_id_in(std::string_view line) {
  const auto at = line.find("addr=x");
  if (at == std::string_view::npos) return std::nullopt;
  const auto text = line.substr(at + 6, 16);
  std::uint64_t out = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out, 16);
  const bool ends = end == text.data() + text.size() || *end == ' ' || *end == '\r';
  return error == std::errc{} && end - text.data() >= 4 && ends ? std::optional(out) : std::nullopt;
}

std::string loc_get_request() { return {'\x0c', '\0'}; }

Result<std::optional<Location>> parse_location(std::string_view bytes) {
  using Found = std::optional<Location>;
  const auto bad = [](const char* why) { return make_error(Errc::bad_frame, why); };
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(bytes[i]); };
  constexpr std::array<std::uint8_t, 2> k_head{k_status, 1};
  for (std::size_t i = 0; i < k_head.size() && i < bytes.size(); ++i) {
    if (byte(i) != k_head[i]) return bad("no answer of this protocol");
  }
  if (bytes.size() < 3) return Found{};
  Location out;
  out.error = byte(2);
  out.bytes = 3;
  if (out.error != 0) return Found(std::move(out));
  while (true) {
    if (bytes.size() < out.bytes + 2) return Found{};
    const std::uint8_t type = byte(out.bytes);
    const std::size_t length = byte(out.bytes + 1), at = out.bytes + 2;
    if (type != k_own_position && type != k_of_anchor && type != k_of_tag)
      return bad("a value of an unknown type");
    if (type == k_own_position && length != k_position) return bad("a position of another length");
    if (bytes.size() < at + length) return Found{};
    out.bytes = at + length;
    if (type == k_own_position) {
      const auto mm = [&](std::size_t i) {
        return static_cast<std::int32_t>(little(bytes, at + i, 4)) * 1e-3;
      };
      out.estimate = Estimate{mm(0), mm(4), mm(8), byte(at + 12)};
      continue;
    }
    if (type == k_of_anchor) {
      out.is_anchor = true;
      return Found(std::move(out));
    }
    if (length == 0 || length != 1 + k_anchor * byte(at))
      return bad("distances of another length than their number");
    for (std::size_t i = at + 1; i < at + length; i += k_anchor) {
      out.distances.push_back({static_cast<std::uint16_t>(little(bytes, i, 2)),
                               little(bytes, i + 2, 4) * 1e-3, static_cast<int>(byte(i + 6))});
    }
    return Found(std::move(out));
  }
}

}  // namespace anchord::dwm1001
