#pragma once

#include <string>

#include "core/types/mission.hpp"

namespace anchord::flight {

/// Those of a mission: "0x6e01, 0x6e02"
inline std::string tags_text(const Mission& mission) {
  std::string out;
  for (const auto& one : mission.tags) {
    const auto id = to_string(one.tag) + (one.antenna == 0 ? "" : " antenna " + std::to_string(one.antenna));
    out += (out.empty() ? "" : ", ") + id;
  }
  return out;
}

}  // namespace anchord::flight
