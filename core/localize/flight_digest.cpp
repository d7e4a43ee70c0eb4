#include "core/localize/flight_digest.hpp"

#include "core/base/sha256.hpp"

namespace anchord {

std::string flight_digest(const FlightData& flight) {
  Sha256 sha;
  const auto add_time = [&](UtcTime time) { sha.add(static_cast<std::uint64_t>(time.ns)); };
  for (const Fix& fix : flight.fixes) {
    add_time(fix.time);
    if (fix.frame == TrackFrame::local) {
      for (const double v : fix.local_m) sha.add(v);
    } else {
      sha.add(fix.position.lat_deg);
      sha.add(fix.position.lon_deg);
      sha.add(fix.position.height_m);
    }
  }
  for (std::size_t i = 0; i < flight.n_ranges(); ++i) {
    const FlightRange range = flight.range(i);
    add_time(range.time);
    sha.add(std::uint64_t{range.tag.value});
    sha.add(std::uint64_t{range.anchor.value});
    sha.add(range.distance_m);
  }
  return sha.hex().substr(0, 32);
}

}  // namespace anchord
