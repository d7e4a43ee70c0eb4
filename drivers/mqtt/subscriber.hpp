#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "drivers/mapping/decoder.hpp"
#include "drivers/mqtt/packet.hpp"
#include "drivers/mqtt/pozyx_positions.hpp"
#include "drivers/port/driver.hpp"

namespace anchord::mqtt {

struct SubscriberOptions {
  std::string client_id, user, password_file;  ///< the password is in no setting and in no recording
  std::string topic;                           ///< filter
  std::optional<mapping::Mapping> mapping{};   ///< ranges; absent: positions of a Pozyx gateway
};

/// Messages of an MQTT broker as a device: ranges by a mapping, or the position stream of Pozyx Creator and
/// Enterprise, which has no ranges; its positions answer the command `positions`. MQTT 3.1.1 at QoS 0, over
/// plain TCP. Kept messages of before the subscription are not used: they are no measurement of now. See
/// device::Driver.
class Subscriber final : public device::Driver {
 public:
  Subscriber(SubscriberOptions options, device::DriverOutput& output);

  void opened(const device::Arrival& now) override;
  void bytes(std::string_view bytes, const device::Arrival& at) override;
  void tick(const device::Arrival& now) override;
  std::optional<std::int64_t> deadline_ns() const override { return deadline_ns_; }
  void closed(const device::Arrival& now) override;
  void command(const device::Command& command, const device::Arrival& now) override;

 private:
  enum class State : std::uint8_t { closed, connecting, subscribing, live, refused };
  void packet(const Packet& packet, const device::Arrival& at);
  void accepted(const Packet& packet, const device::Arrival& at);
  void message(const Packet& packet, const device::Arrival& at);
  void refuse(const std::string& why, std::int64_t wait_s);

  SubscriberOptions options_;
  device::DriverOutput& out_;
  PacketReader reader_;
  std::variant<mapping::Decoder, PozyxPositions> decoder_;
  State state_{State::closed};
  bool first_{true};  ///< no byte came yet
  std::optional<std::int64_t> deadline_ns_{};
  std::int64_t last_ns_{0};  ///< when the broker was last heard
};

/// {"mapping": {...}} or {"format": "pozyx", "topic"}; and user, password_file. errors: invalid_argument,
/// naming the option
Result<std::unique_ptr<device::Driver>> make_subscriber(std::string_view options_json,
                                                        std::string_view device_id,
                                                        device::DriverOutput& output);

}  // namespace anchord::mqtt
