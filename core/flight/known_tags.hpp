#pragma once

#include <algorithm>
#include <string>

#include "core/types/mission.hpp"
#include "core/types/range.hpp"

namespace anchord::flight {

/// Whether its ranges can be used: a mission that declares no tags takes any, one that does knows its own.
inline bool has_tag(const Mission& mission, const Range& range) {
  const auto is_it = [&](const TagAntenna& one) {
    return one.tag == range.tag && one.antenna == range.antenna;
  };
  return mission.tags.empty() || std::ranges::any_of(mission.tags, is_it);
}

/// "0x6e01, 0x6e02"
inline std::string tags_text(const Mission& mission) {
  std::string out;
  for (const auto& one : mission.tags) {
    const auto id = to_string(one.tag) + (one.antenna == 0 ? "" : " antenna " + std::to_string(one.antenna));
    out += (out.empty() ? "" : ", ") + id;
  }
  return out;
}

}  // namespace anchord::flight
