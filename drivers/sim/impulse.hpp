#pragma once

#include <cstdint>
#include <vector>

#include "drivers/sim/radio.hpp"

namespace anchord::sim {

/// The simulated receiver's channel impulse response. docs/radio-model.md.
struct ImpulseOptions {
  std::size_t taps = 1016;  ///< DW1000 accumulator at PRF 64 MHz; 992 at 16 MHz
  double decay_ns = 18;     ///< of the diffuse tail's power
  double floor_dbm = -118;  ///< level at which a first path is as strong as the noise of one tap
  double diffuse_db = 9;    ///< tail below the first path in the open
  double tail_per_loss =
      0.65;  ///< of a wall's loss in dB that the tail, coming by other ways, does not suffer
};

/// Interleaved re, im of one received frame (2 x taps values): complex noise of 20..60 counts, a first path
/// near tap 746 with a pulse of three samples, a diffuse tail that falls exponentially, behind walls a
/// stronger echo later. Phases are random from frame to frame. Clipped at +-32767.
std::vector<std::int16_t> simulate_impulse(const Exchange& exchange, const ImpulseOptions& options,
                                           Random& random);

}  // namespace anchord::sim
