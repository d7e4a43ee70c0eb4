#include "server/flight/demonstration_flight.hpp"

#include "drivers/sim/flight.hpp"

namespace anchord::flight {

Result<FlightData> demonstration_flight() {
  sim::SimulationOptions options;
  options.seed = 7;
  BOOST_OUTCOME_TRY(auto flight, sim::simulate_flight(sim::demonstration_world(), options));
  return std::move(flight.data);
}

}  // namespace anchord::flight
