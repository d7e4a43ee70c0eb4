#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "core/localize/live_flight.hpp"
#include "core/types/estimate.hpp"

namespace anchord::flight {

/// What happens in a live mission, in order. Whoever drives it makes of them what the world sees: a
/// message of a topic, a row of the event log, an input of the procedure. Where the aircraft is,
/// PositionWatch tells.

struct RangeDecided {
  RangeResult result;
};
/// An anchor answered for the first time.
struct AnchorFound {
  NetworkId anchor{};
  bool now{true};  ///< not read from what was stored
};
/// It became converged or ambiguous (anchor_status).
struct AnchorStatusChanged {
  NetworkId anchor{};
  std::string_view status;
  std::string reason;  ///< of the verdict
};
struct AnchorEstimated {
  Estimate estimate;
  std::optional<double> models_moved_m{};  ///< LiveFlight::model_shift
};
/// The first position of this mission that was rejected for this reason; later ones are counted.
struct FixRejected {
  std::string reason;
};
/// The first positions were no part of the flight: every estimate is in another frame from here on.
struct OriginMoved {};

using Event =
    std::variant<RangeDecided, AnchorFound, AnchorStatusChanged, AnchorEstimated, FixRejected, OriginMoved>;

/// found (no position yet), estimating, ambiguous or converged: within the accuracy goal, and no gate holds
/// it back (reached_goal).
std::string_view anchor_status(const Estimate& estimate);

}  // namespace anchord::flight
