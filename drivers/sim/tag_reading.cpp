#include "drivers/sim/tag_reading.hpp"

#include <cmath>

#include "drivers/pozyx/cir_record.hpp"

namespace anchord::sim {

void read_as_tag(Range& range, const Exchange& exchange, const ImpulseOptions& impulse, Random& random) {
  constexpr double k_prf_64_db = 121.74;  // A of eq 5.6
  range.distance_m = std::round(exchange.distance_m * 1000) / 1000;
  range.rss_dbm = std::round(exchange.rss_dbm);
  pozyx::take_record(range, pozyx::window_of(simulate_impulse(exchange, impulse, random)), k_prf_64_db);
}

}  // namespace anchord::sim
