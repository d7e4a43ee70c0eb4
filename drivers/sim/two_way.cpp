#include "drivers/sim/two_way.hpp"

namespace anchord::sim {
namespace {

constexpr double k_light_mps = 299'792'458.0;

}  // namespace

double two_way_distance_m(double round_a_s, double reply_b_s) {
  return 0.5 * k_light_mps * (round_a_s - reply_b_s);
}

double two_way_error_m(double reply_b_s, double error_a, double error_b) {
  return 0.5 * k_light_mps * reply_b_s * (error_a - error_b);
}

double double_sided_distance_m(double round_a_s, double reply_a_s, double round_b_s, double reply_b_s) {
  return 0.25 * k_light_mps * ((round_a_s - reply_a_s) + (round_b_s - reply_b_s));
}

double double_sided_error_m(double delta_s, double error_a, double error_b) {
  return 0.25 * k_light_mps * delta_s * (error_a - error_b);
}

double clocked_distance_m(const TwoWayExchange& exchange, double true_distance_m, double error_a,
                          double error_b) {
  const double flight_s = true_distance_m / k_light_mps;
  const double round_a_s = (2 * flight_s + exchange.reply_b_s) * (1 + error_a);
  const double reply_b_s = exchange.reply_b_s * (1 + error_b);
  if (exchange.scheme == TwoWayScheme::single_sided) return two_way_distance_m(round_a_s, reply_b_s);
  const double round_b_s = (2 * flight_s + exchange.reply_a_s) * (1 + error_b);
  const double reply_a_s = exchange.reply_a_s * (1 + error_a);
  return double_sided_distance_m(round_a_s, reply_a_s, round_b_s, reply_b_s);
}

}  // namespace anchord::sim
