#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/ports/drone.hpp"
#include "drivers/drone/dialect.hpp"
#include "drivers/mavlink/frame.hpp"

namespace anchord::drone {

/// An item of a mission or a fence, as MISSION_ITEM_INT has it.
struct MissionItem {
  int command{}, frame{};
  double p1{}, p2{}, p3{}, p4{};
  std::int32_t x{}, y{};
  double z{};
  bool operator==(const MissionItem&) const = default;
};
enum class ItemList : std::uint8_t { mission = 0, fence = 1 };

struct SessionOptions {
  mavlink::Address self{255, 190};  ///< 255: what ArduPilot's failsafe listens to by default
  double confirm_s = 2.0;           ///< no acknowledgement by then: unconfirmed
  double repeat_s = 1.0;            ///< a command is sent twice within confirm_s, confirmation counted up
  double arm_s = 60;  ///< arming is tried this long: pre-arm checks take up to 30 s after the fix
  double max_jump_m = 200;
  std::optional<mavlink::Secret> secret{};  ///< of MAVLink signing; set on the autopilot over a wire
};

/// One conversation with one autopilot: bytes and time in, bytes out. No socket, no clock, no thread.
///
/// Never trusts an acknowledgement alone: arming, mode and targets are confirmed by telemetry. A mode change
/// that we did not command is the pilot's or a failsafe's: from then on no target is sent.
class Session final : public Drone {
 public:
  explicit Session(SessionOptions options = {});

  void feed(double now_s, std::int64_t unix_us, std::span<const std::uint8_t> bytes);
  /// At least ten times a second: heartbeat, repeats, time-outs.
  void tick(double now_s, std::int64_t unix_us);
  std::vector<std::uint8_t> take_bytes();
  /// The aircraft on the link is another one: the next autopilot that is heard is taken.
  void forget_vehicle();

  std::uint64_t take_off(double height_m) override;
  std::uint64_t go_to(double lat_deg, double lon_deg, double height_m,
                      std::optional<double> heading_deg) override;
  std::uint64_t hold() override;
  std::uint64_t return_home() override;
  std::uint64_t land() override;
  std::uint64_t upload_route(const std::vector<RoutePoint>& route) override;
  std::uint64_t upload_fence(const DroneFence& fence) override;
  void take_back() override { status_.taken_over = false; }
  DroneStatus status() const override;
  std::vector<CommandReport> take_reports() override;

  /// Whole lists; one transfer at a time. Its end is a report named upload or download.
  std::uint64_t upload(ItemList list, std::vector<MissionItem> items);
  std::uint64_t download(ItemList list);
  const std::vector<MissionItem>& downloaded() const { return items_; }
  const mavlink::Framer::Counters& counters() const { return framer_.counters(); }

 private:
  struct Pending {
    std::uint64_t number{};
    std::string what;
    mavlink::Message message;
    int command{};
    double first_s{}, last_s{};
    int sent{1};
  };
  struct TakeOff {
    std::uint64_t number{};
    double height_m{}, begun_s{}, tried_s{-10};
    enum class Stage : std::uint8_t { mode, arm, climb } stage{Stage::mode};
  };
  struct Target {
    std::uint64_t number{};
    mavlink::Message message;
    double lat_deg{}, lon_deg{}, height_m{}, begun_s{}, sent_s{}, from_m{};
    bool confirmed{false};
  };
  struct Transfer {
    std::uint64_t number{};
    bool up{false};
    ItemList list{};
    std::vector<MissionItem> items;
    std::size_t count{}, next{};
    double last_s{};
    int tries{0};
    bool check{false};                ///< of an upload: is read back
    std::vector<MissionItem> wanted;  ///< of the reading back
  };

  void handle(const mavlink::Received& in);
  void on_heartbeat(const mavlink::Received& in);
  void on_ack(const mavlink::Message& m);
  void on_transfer(const mavlink::Message& m);
  void ask_rates();
  void send(const mavlink::Message& message);
  void command(std::uint64_t number, const std::string& what, int command_number,
               std::initializer_list<double> params);
  std::uint64_t mode(const std::string& what, std::uint32_t Dialect::*custom_mode);
  bool deaf(std::uint64_t number, const std::string& what);
  void report(std::uint64_t number, const std::string& what, CommandState state, std::string text);
  void drive_take_off();
  void drive_target();
  void drive_transfer();
  void repeat_commands();
  double distance_m(double lat_deg, double lon_deg, double height_m) const;
  mavlink::Message addressed(std::string_view name) const;
  void send_item(std::size_t index);
  std::uint64_t upload_checked(ItemList list, std::vector<MissionItem> items);
  void end_transfer(CommandState state, std::string text);

  SessionOptions options_;
  mavlink::Framer framer_;
  mavlink::Packer packer_;
  std::vector<std::uint8_t> out_;
  double now_s_{0}, heartbeat_s_{-10}, rates_s_{-100};
  std::optional<double> heard_s_, target_told_s_;
  mavlink::Address vehicle_{0, 0};
  Autopilot autopilot_{Autopilot::unknown};
  DroneStatus status_;
  std::uint32_t custom_mode_{0};
  std::optional<std::uint32_t> commanded_mode_;
  std::optional<double> commanded_s_;
  std::optional<double> home_msl_m_;
  std::string refusal_;  ///< newest text of the autopilot that says why it refuses
  std::uint64_t number_{0};
  std::deque<Pending> pending_;
  std::optional<TakeOff> take_off_;
  std::optional<Target> target_;
  std::optional<Transfer> transfer_;
  std::vector<MissionItem> items_;
  std::vector<CommandReport> reports_;
};

}  // namespace anchord::drone
