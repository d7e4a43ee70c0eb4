#include "drivers/sim/impulse.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

namespace anchord::sim {
namespace {

using Taps = std::vector<std::complex<double>>;

constexpr double k_tap_ns = 1.001602564;  ///< 64 ticks of 1 / (128 x 499.2 MHz)

/// Adds a pulse whose top lies at a fractional tap. 0.77 : 1 : 0.73 around the top is what records show
/// (dw1000-diagnostics.md section 6); a Gaussian of this width gives 0.75 on both sides.
void add_pulse(Taps& taps, double top, double amplitude, double phase_rad) {
  constexpr double k_width = 1.32;
  const auto first = static_cast<std::ptrdiff_t>(std::floor(top)) - 3;
  for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(first, 0);
       k < first + 8 && k < static_cast<std::ptrdiff_t>(taps.size()); ++k) {
    const double z = (static_cast<double>(k) - top) / k_width;
    taps[static_cast<std::size_t>(k)] += std::polar(amplitude * std::exp(-0.5 * z * z), phase_rad);
  }
}

std::int16_t count_of(double value) {
  return static_cast<std::int16_t>(std::lround(std::clamp(value, -32767.0, 32767.0)));
}

}  // namespace

std::vector<std::int16_t> simulate_impulse(const Exchange& exchange, const ImpulseOptions& options,
                                           Random& random) {
  constexpr double k_turn = 2 * std::numbers::pi;
  Taps taps(options.taps);
  const double sigma = 20.0 + 40.0 * random.uniform();
  const double first = std::clamp(746.0 + 5.0 * random.normal(), 730.0, 765.0);
  const double amplitude = sigma * std::pow(10.0, std::max(exchange.rss_dbm - options.floor_dbm, 0.0) / 20.0);
  // The tag reports the level of all that arrives; walls take from the first path what the rest does not
  // lose.
  const double tail_db = -options.diffuse_db + options.tail_per_loss * exchange.wall_loss_db;
  const double tail = std::pow(10.0, tail_db / 10.0);  // its power against the first path's
  const double direct = amplitude / std::sqrt(1.0 + tail);
  add_pulse(taps, first + 2.0, direct, k_turn * random.uniform());

  // Diffuse: every tap after the pulse a complex Gaussian, power falling exponentially.
  const double decay = options.decay_ns / k_tap_ns;
  const double per_tap = direct * std::sqrt(tail / decay);
  const auto from = static_cast<std::size_t>(first) + 4;
  for (std::size_t k = from; k < std::min(taps.size(), from + static_cast<std::size_t>(8 * decay)); ++k) {
    const double scale =
        per_tap * std::exp(-0.5 * static_cast<double>(k - from) / decay) / std::numbers::sqrt2;
    const double re = random.normal(), im = random.normal();
    taps[k] += std::complex<double>(scale * re, scale * im);
  }
  // A single strong echo 2..30 taps later; with walls it is the peak of the record.
  const double echo_after = 4.0 + 20.0 * random.uniform() * random.uniform();
  add_pulse(taps, first + 2.0 + echo_after, direct * std::sqrt(0.6 * tail), k_turn * random.uniform());

  std::vector<std::int16_t> out;
  out.reserve(2 * taps.size());
  const double per_axis = sigma / std::numbers::sqrt2;
  for (const std::complex<double>& tap : taps) {
    const double re = random.normal(), im = random.normal();
    out.push_back(count_of(tap.real() + per_axis * re));
    out.push_back(count_of(tap.imag() + per_axis * im));
  }
  return out;
}

}  // namespace anchord::sim
