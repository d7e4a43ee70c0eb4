#pragma once

#include <cstdint>

#include "core/base/enum_table.hpp"

namespace anchord::sim {

/// Two-way ranging and what free-running crystals make of it (chapter 2.2 of the dissertation). Times in
/// seconds as the devices' clocks count them; e is the relative frequency error of a crystal (12 ppm: 12e-6).

/// eq 2.1: d = c (t_round,A - t_reply,B) / 2
double two_way_distance_m(double round_a_s, double reply_b_s);
/// eq 2.2 in metres: c t_reply,B (e_A - e_B) / 2. Dominant part; e_A d, 0.1 mm at 10 m, is left out.
double two_way_error_m(double reply_b_s, double error_a, double error_b);
/// eq 2.3: d = c (t_round,A - t_reply,A + t_round,B - t_reply,B) / 4
double double_sided_distance_m(double round_a_s, double reply_a_s, double round_b_s, double reply_b_s);
/// eq 2.4 in metres: c delta (e_A - e_B) / 4. The print takes delta = t_reply,A - t_reply,B; with A the
/// device that begins, and e positive for a fast crystal, the range comes out long for delta = t_reply,B -
/// t_reply,A.
double double_sided_error_m(double delta_s, double error_a, double error_b);

enum class TwoWayScheme : std::uint8_t { single_sided, double_sided };
inline constexpr auto k_two_way_words = enum_table<TwoWayScheme>(
    {{"single_sided", TwoWayScheme::single_sided}, {"double_sided", TwoWayScheme::double_sided}});

/// How two devices measure their distance.
struct TwoWayExchange {
  TwoWayScheme scheme{TwoWayScheme::double_sided};
  double reply_a_s = 290e-6, reply_b_s = 290e-6;  ///< of a DW1000 at 6.81 Mbit/s, preamble of 128
};

/// The distance such an exchange reports: every interval counted by the clock that measures it.
double clocked_distance_m(const TwoWayExchange& exchange, double true_distance_m, double error_a,
                          double error_b);

}  // namespace anchord::sim
