#pragma once

#include <cstddef>

namespace anchord {

/// So many tags and anchors one flight in the air is solved for, those heard first; ten times what a site
/// has. The rows of others are stored and solved after landing. A device that invents ids must not fill the
/// memory.
inline constexpr std::size_t k_most_live_tags = 64, k_most_live_anchors = 500;

}  // namespace anchord
