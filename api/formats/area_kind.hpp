#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace anchord::api {

/// What a drawing of another program is to a plan.
enum class AreaKind : std::uint8_t { outline, no_fly, fence, waypoint, transit, path };

/// For the message about a kind that is none of them.
inline constexpr std::string_view k_area_kinds = "outline, no_fly, fence, waypoint, transit or path";

/// A kind that stands alone, however it is written: "No fly", "no-fly", "NO_FLY"; nothing: none of them.
std::optional<AreaKind> area_kind(std::string_view word);

/// A kind somewhere in a name or another free text ("Fence of the site"); nothing: it says none.
std::optional<AreaKind> area_kind_in(std::string_view text);

/// An area that bounds a flight: to lose one leaves the aircraft without it.
constexpr bool bounds_flight(std::optional<AreaKind> kind) {
  return kind == AreaKind::fence || kind == AreaKind::no_fly;
}

}  // namespace anchord::api
