#include "api/missions/radio_watch.hpp"

#include <cstdio>

namespace anchord::api {

void RadioWatch::heard(NetworkId id, bool tag, UtcTime measured, SteadyTime now) {
  auto radios = radios_.lock();
  auto& radio = (*radios)[id];
  const double step_s = seconds_between(radio.last_seen, measured);
  if (radio.last_seen.ns != 0 && step_s > 0 && step_s < 10)
    radio.interval_s = radio.interval_s == 0 ? step_s : 0.9 * radio.interval_s + 0.1 * step_s;
  radio.tag = tag;
  radio.last_seen = measured;
  radio.last_arrival = now;
}

std::string RadioWatch::rows_json(SteadyTime now) const {
  std::string json;
  const auto radios = radios_.lock();
  for (const auto& [id, radio] : *radios) {
    const double silent_s = seconds_between(radio.last_arrival, now);
    const char* state = silent_s < 2 ? "live" : silent_s < 5 ? "late" : "lost";
    char rate[32];
    std::snprintf(rate, sizeof rate, "%.1f",
                  radio.interval_s > 0 && silent_s < 5 ? 1 / radio.interval_s : 0.0);
    json += (json.empty() ? "" : ",") + std::string(R"({"network_id":")") + to_string(id) + R"(","kind":")" +
            (radio.tag ? "tag" : "anchor") + R"(","state":")" + state + R"(","last_seen_us":)" +
            std::to_string(radio.last_seen.us()) + R"(,"rate_hz":)" + rate + '}';
  }
  return json;
}

}  // namespace anchord::api
