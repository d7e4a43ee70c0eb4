#pragma once

#include <map>
#include <string>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/steady.hpp"
#include "core/base/time.hpp"

namespace anchord::api {

/// Which tags and anchors are heard, by the ranges that come. Thread-safe.
class RadioWatch {
 public:
  void heard(NetworkId id, bool tag, UtcTime measured, SteadyTime now);
  /// Rows of topic `devices`, joined by commas; empty when nothing was heard yet. Live within 2 s, late
  /// within 5 s, then lost, by arrival: a replayed flight is live too.
  std::string rows_json(SteadyTime now) const;

 private:
  struct Radio {
    bool tag{false};
    UtcTime last_seen{};  ///< measured
    SteadyTime last_arrival{};
    double interval_s{0};  ///< smoothed
  };
  Locked<std::map<NetworkId, Radio>> radios_;
};

}  // namespace anchord::api
