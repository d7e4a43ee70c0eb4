#include "core/localize/flight_digest.hpp"

#include <array>
#include <bit>

#include "core/base/sha256.hpp"

namespace anchord {
namespace {

/// Numbers as Sha256 takes them, many at a time: each call of OpenSSL costs more than the number.
class Gathered {
 public:
  void add(std::uint64_t value) {
    for (int i = 0; i < 8; ++i)
      bytes_[n_++] = static_cast<char>(static_cast<unsigned char>(value >> (8 * i)));
    if (n_ == bytes_.size()) flush();
  }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value + 0.0)); }
  std::string hex() {
    flush();
    return sha_.hex();
  }

 private:
  void flush() {
    sha_.add(std::string_view{bytes_.data(), n_});
    n_ = 0;
  }
  Sha256 sha_;
  std::array<char, 4096> bytes_{};
  std::size_t n_{0};
};

std::string digest_since(UtcTime origin, const FlightData& flight) {
  Gathered sha;
  const auto add_time = [&](UtcTime time) { sha.add(static_cast<std::uint64_t>(time.ns - origin.ns)); };
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

}  // namespace

std::string flight_digest(const FlightData& flight) {
  UtcTime first{};
  if (!flight.fixes.empty())
    first = flight.fixes.front().time;
  else if (flight.n_ranges() > 0)
    first = flight.range(0).time;
  return digest_since(first, flight);
}

std::string dated_flight_digest(const FlightData& flight) { return digest_since(UtcTime{}, flight); }

}  // namespace anchord
