#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace anchord::gnss {

/// The whole text as a finite number; nothing otherwise ("1.5x", "nan", "").
inline std::optional<double> to_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// The whole text as an integer of digits only, at most nine.
inline std::optional<int> to_integer(std::string_view text) {
  if (text.empty() || text.size() > 9) return std::nullopt;
  int value = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') return std::nullopt;
    value = value * 10 + (c - '0');
  }
  return value;
}

/// Decimal seconds such as "20", "20.2": whole seconds and exact nanoseconds (digits beyond are dropped).
struct Seconds {
  int whole{};
  std::int64_t fraction_ns{};
};
inline std::optional<Seconds> to_seconds(std::string_view text) {
  const auto dot = text.find('.');
  const auto whole = to_integer(text.substr(0, dot));
  if (!whole) return std::nullopt;
  Seconds out{*whole, 0};
  if (dot != std::string_view::npos) {
    std::int64_t unit = 100'000'000;
    for (const char c : text.substr(dot + 1)) {
      if (c < '0' || c > '9') return std::nullopt;
      out.fraction_ns += (c - '0') * unit;
      unit /= 10;
    }
  }
  return out;
}

inline std::vector<std::string_view> split(std::string_view text, std::string_view separators,
                                           bool join_runs) {
  std::vector<std::string_view> out;
  std::size_t from = 0;
  while (from <= text.size()) {
    auto end = text.find_first_of(separators, from);
    if (end == std::string_view::npos) end = text.size();
    if (!join_runs || end > from) out.push_back(text.substr(from, end - from));
    from = end + 1;
  }
  return out;
}

}  // namespace anchord::gnss
