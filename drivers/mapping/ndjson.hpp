#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "drivers/mapping/decoder.hpp"
#include "drivers/port/driver.hpp"

namespace anchord::mapping {

/// A home-made tag: one JSON message a line over a serial line, TCP or UDP. See device::Driver.
class Ndjson final : public device::Driver {
 public:
  /// datagrams: the end of each delivery ends a line (UDP).
  Ndjson(Mapping mapping, bool datagrams, device::DriverOutput& output)
      : decoder_(std::move(mapping), output), out_(output), datagrams_(datagrams) {}

  void opened(const device::Arrival& now) override;
  void bytes(std::string_view bytes, const device::Arrival& at) override;
  void closed(const device::Arrival& now) override;
  void command(const device::Command& command, const device::Arrival& now) override;

 private:
  void line(const device::Arrival& at);

  Decoder decoder_;
  device::DriverOutput& out_;
  bool datagrams_;
  bool first_{true};  ///< a port is opened in the middle of a line
  bool over_{false};  ///< the line is too long: skipped up to its end
  std::string line_;
};

/// {"mapping": {...}}. errors: invalid_argument, naming the option
Result<std::unique_ptr<device::Driver>> make_ndjson(std::string_view options_json, bool datagrams,
                                                    device::DriverOutput& output);

}  // namespace anchord::mapping
