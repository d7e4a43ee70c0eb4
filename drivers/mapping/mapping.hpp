#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"

namespace anchord::mapping {

/// Where a value is found.
struct Place {
  enum class In : std::uint8_t { element, message, topic, fixed };
  In in{In::element};
  std::vector<std::string> path;  ///< JSON pointer (RFC 6901), taken apart; of element and message
  std::size_t level{0};           ///< of the topic, the first is 1
  std::string text;               ///< fixed
};

/// A number in the unit that the product has.
struct Quantity {
  Place at;
  double factor{1};  ///< of the unit, times `scale`
};

enum class TimeUnit : std::uint8_t { s, ms, us, ns, rfc3339 };
inline constexpr auto k_time_unit_words = enum_table<TimeUnit>({{"s", TimeUnit::s},
                                                                {"ms", TimeUnit::ms},
                                                                {"us", TimeUnit::us},
                                                                {"ns", TimeUnit::ns},
                                                                {"rfc3339", TimeUnit::rfc3339}});

enum class IdFormat : std::uint8_t { any, decimal, hex };
inline constexpr auto k_id_format_words =
    enum_table<IdFormat>({{"any", IdFormat::any}, {"decimal", IdFormat::decimal}, {"hex", IdFormat::hex}});

/// How messages of some UWB system say ranges (docs/integration.md has the keys).
struct Mapping {
  std::string topic;          ///< filter of MQTT; empty: the mapping names none
  std::optional<Place> list;  ///< one element a range; absent: the message is one
  Place tag, anchor;
  IdFormat id_format{IdFormat::any};
  std::string id_prefix;                 ///< before every id, taken off
  std::map<std::string, NetworkId> ids;  ///< of words that are no numbers
  Quantity distance;
  struct Time {
    Quantity value;
    TimeUnit unit{TimeUnit::s};
    bool of_device{false};           ///< counts from when it was switched on; else Unix time
    std::optional<int> wrap_bits{};  ///< of such a counter
  };
  std::optional<Time> time{};  ///< absent: the arrival
  std::optional<Quantity> rss, first_path, received_power;
  std::optional<Place> seq{};
};

/// From its JSON object. errors: invalid_argument, each fault with where it is and what would be right.
Result<Mapping> parse_mapping(std::string_view json);

/// Why text is no topic filter of MQTT 3.1.1; empty: it is one.
std::string wrong_filter(std::string_view filter);

/// An id as the mapping's messages have it, text or number. Nothing: it is none.
std::optional<NetworkId> id_of(const Mapping& mapping, std::string_view text);

}  // namespace anchord::mapping
