#pragma once

#include <cstdint>
#include <map>
#include <string_view>

#include "drivers/mapping/mapping.hpp"
#include "drivers/port/driver.hpp"
#include "drivers/time/clock_model.hpp"

namespace anchord::mapping {

/// Messages of some UWB system to ranges, by a mapping. What cannot be used is counted by reason
/// (DriverOutput::dropped): not_utf8, not_json, too_deep, too_large, no_array, too_many, bad_tag, bad_anchor,
/// bad_distance, out_of_reach, bad_time, time_off, bad_power, too_many_tags. Bears any bytes; never throws on
/// content.
class Decoder {
 public:
  static constexpr std::size_t k_most_bytes = 256 * 1024;  ///< of a message
  static constexpr int k_most_depth = 32;
  static constexpr std::size_t k_most_elements = 10'000;

  Decoder(Mapping mapping, device::DriverOutput& output) : mapping_(std::move(mapping)), out_(output) {}
  const Mapping& mapping() const { return mapping_; }

  /// topic: that of MQTT; empty elsewhere.
  void message(std::string_view text, std::string_view topic, const device::Arrival& at);
  /// The connection ended: what was known of the devices' clocks is of no use.
  void closed() { clocks_.clear(); }

 private:
  struct Values;
  /// Whether a counter runs at about the rate of time. One that stands still, or of another unit, would stamp
  /// ranges by seconds too early.
  class Pace {
   public:
    /// As of now; as before until a second and five arrivals tell.
    bool add(std::int64_t device_ns, std::int64_t arrival_ns);
    bool keeps() const { return keeps_; }

   private:
    std::int64_t device_ns_{}, first_ns_{}, last_ns_{};  ///< at the beginning of the span; newest arrival
    int arrivals_{0};
    bool keeps_{true};
  };
  struct Clock {
    timing::ClockModel model{};
    Pace pace{};
    std::optional<timing::Unwrap> unwrap{};
  };
  bool range(const Values& values, const device::Arrival& at);
  std::optional<UtcTime> time(const Values& values, NetworkId tag, const device::Arrival& at);
  /// Null: too many tags.
  Clock* clock_of(NetworkId tag);
  std::int64_t steady_of(Clock& clock, NetworkId tag, std::int64_t device_ns, const device::Arrival& at);

  Mapping mapping_;
  device::DriverOutput& out_;
  std::map<NetworkId, Clock> clocks_;
  std::uint64_t seq_{0};
};

/// Whether brackets nest deeper than `most`, outside of strings: asked before a parser that would recurse.
bool too_deep(std::string_view json, int most);

}  // namespace anchord::mapping
