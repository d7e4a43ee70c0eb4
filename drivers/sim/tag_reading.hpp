#pragma once

#include "core/types/range.hpp"
#include "drivers/sim/impulse.hpp"

namespace anchord::sim {

/// What the real driver makes of an exchange over a real wire: distance in whole millimetres, level in whole
/// dBm, the window of 128 taps with its diagnosis. For measurements that are made without a port.
///
/// impulse  at least 800 taps
void read_as_tag(Range& range, const Exchange& exchange, const ImpulseOptions& impulse, Random& random);

}  // namespace anchord::sim
