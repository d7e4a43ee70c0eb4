#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>

#include "drivers/gnss/decoder.hpp"
#include "drivers/port/driver.hpp"
#include "drivers/port/one_source.hpp"

namespace anchord::gnss {

struct RoverOptions {
  std::optional<Protocol> format{};  ///< absent: found out
  nmea::GstOrder gst_order{nmea::GstOrder::larger_for_both};
  /// Between the instant of measurement and the first byte of it, at least: computing and link. Of the clock
  /// model; makers state 20 to 100 ms.
  double latency_s{0.05};
  std::string gpsd_device;       ///< which of a gpsd's receivers; empty: the first one, or the first with RTK
  bool takes_corrections{true};  ///< of an NTRIP client here; false: it has its own way to a base
};

/// One RTK rover, whatever it speaks. Where a wire carries several formats, the one that says most is used
/// (UBX, ERB, LLH, gpsd, NMEA) and the others' epochs are counted as dropped, since they are the same
/// positions again. Epochs are given out when complete or when the wire has been quiet for 50 ms. See
/// device::Driver.
class Rover final : public device::Driver {
 public:
  Rover(RoverOptions options, device::DriverOutput& output);

  void opened(const device::Arrival& now) override;
  void bytes(std::string_view bytes, const device::Arrival& at) override;
  void tick(const device::Arrival& now) override;
  std::optional<std::int64_t> deadline_ns() const override { return quiet_at_ns_; }
  void closed(const device::Arrival& now) override;
  void command(const device::Command& command, const device::Arrival& now) override;
  /// A gpsd takes commands on its socket, and would read corrections as such.
  bool takes_corrections() const override {
    return options_.takes_corrections && options_.format != Protocol::gpsd && !watching_;
  }

 private:
  void greet_gpsd(std::string_view bytes);
  void watch();
  void give(Epochs& epochs, const device::Arrival& now);
  void give_one(const Epoch& epoch, const device::Arrival& at);
  bool chosen(const Epoch& epoch, const device::Arrival& at);
  bool is_lone_step(UtcTime measured, const device::Arrival& at);
  void count();

  RoverOptions options_;
  device::DriverOutput& out_;
  std::optional<Decoder> decoder_;
  std::map<std::string, std::uint64_t, std::less<>> skipped_;  ///< told so far
  std::uint64_t frames_{0};
  std::string greeting_;  ///< first bytes of a connection, until a gpsd has said its VERSION
  bool watching_{false};
  std::optional<std::int64_t> quiet_at_ns_{};
  device::Arrival burst_{}, last_{}, given_{};  ///< first bytes after a pause; newest bytes; newest epochs
  std::optional<Protocol> speaks_{};
  std::int64_t spoke_ns_{0};
  std::optional<UtcTime> newest_{};
  std::optional<std::int64_t> most_ahead_ns_{};  ///< UTC of an epoch minus steady clock of its arrival
  std::optional<std::int64_t> step_ns_{};        ///< the same, of an epoch that nothing confirms yet
  std::optional<std::int64_t> undated_since_ns_{};
  std::uint64_t seq_{0};
  std::optional<device::Identity> identity_{};
  device::OneSource<std::string> receiver_{};  ///< of a gpsd's
};

}  // namespace anchord::gnss
