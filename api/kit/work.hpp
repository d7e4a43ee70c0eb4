#pragma once

#include <cstdint>

namespace anchord::api {

/// Which executor runs a request: declared by its route, so that what keeps an aircraft safe never waits
/// behind what computes.
enum class Work : std::uint8_t {
  command,   ///< hold, land, lease, alarms, health: never computes, never waits for the disk longer than a
             ///< moment
  flight,    ///< the rest of flying (start, checklist, uploads): may wait for the disk
  ordinary,  ///< reads and writes of some milliseconds
  heavy,     ///< computations and large answers: few at a time, and few of one token
};

}  // namespace anchord::api
