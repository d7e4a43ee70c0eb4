#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/ports/drone.hpp"
#include "drivers/drone/dialect.hpp"
#include "drivers/drone/telemetry.hpp"
#include "drivers/mavlink/frame.hpp"

namespace anchord::drone {

/// A mode that was accepted shows in the heartbeat by then, as a rule: PX4 answers before its state machine
/// has run.
inline constexpr double k_mode_shows_s = 1.5;

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
  mavlink::Address self{k_station_system, k_station_component};
  double confirm_s = 2.0;  ///< neither answered nor seen to be done by then: unconfirmed, given up
  double repeat_s = 0.5;   ///< within confirm_s, confirmation counted up
  double climb_s = 15;     ///< a take-off that was accepted shows by then
  double max_jump_m = 200;
  std::optional<mavlink::Secret> secret{};  ///< of MAVLink signing; set on the autopilot over a wire
};

/// One conversation with one autopilot: bytes and time in, bytes out. No socket, no clock, no thread.
///
/// Never trusts an acknowledgement alone: arming, disarming, mode and targets are confirmed by telemetry.
/// Whatever was not confirmed within confirm_s is reported and never sent again by itself. Any mode that was
/// not commanded in a flight is the pilot's or a failsafe's: what waits is dropped, and no target, take-off
/// or repeat is sent until take_back(). A mode of ours that stays although the next was acknowledged is
/// neither.
class Session final : public Drone {
 public:
  explicit Session(SessionOptions options = {});

  void feed(double now_s, std::int64_t unix_us, std::span<const std::uint8_t> bytes);
  /// At least ten times a second: heartbeats, repeats, time-outs.
  void tick(double now_s, std::int64_t unix_us);
  std::vector<std::uint8_t> take_bytes();
  /// The aircraft on the link is another one: the next autopilot that is heard is taken.
  void forget_vehicle();
  /// Until it was heard no other is taken.
  void expect_vehicle(mavlink::Address vehicle);

  void new_flight(double speed_mps) override;
  void end_flight() override;
  std::uint64_t take_off(double above_ground_m) override;
  std::uint64_t go_to(double lat_deg, double lon_deg, double height_m,
                      std::optional<double> heading_deg) override;
  void steer(double lat_deg, double lon_deg, double height_m) override;
  std::uint64_t hold() override;
  std::uint64_t return_home() override;
  std::uint64_t land() override;
  std::uint64_t disarm() override;
  std::uint64_t upload_route(const std::vector<RoutePoint>& route) override;
  std::uint64_t upload_fence(const DroneFence& fence) override;
  void ask_parameters(const std::vector<std::string>& names) override;
  void take_back() override;
  DroneStatus status() const override;
  std::vector<CommandReport> take_reports() override;

  /// Whole lists; one transfer at a time, for which the newest upload of each list waits. Its end is a report
  /// named upload or download. check: it is read back, and accepted only where that is the same.
  std::uint64_t upload(ItemList list, std::vector<MissionItem> items, bool check = false);
  std::uint64_t download(ItemList list);
  const std::vector<MissionItem>& downloaded() const { return items_; }
  const mavlink::Framer::Counters& counters() const { return framer_.counters(); }

 private:
  /// What shows that it was done.
  enum class Proof : std::uint8_t { answer, mode, disarmed };
  /// Waits for its answer, and for its proof.
  struct Pending {
    std::uint64_t number{};
    std::string what;  ///< of the report; part_of_another: mode, arm and climb of a take-off or a target
    mavlink::Message message;
    int command{};
    bool part{false};  ///< of a command that reports itself
    Proof proof{Proof::answer};
    std::uint32_t mode{};  ///< of Proof::mode
    double first_s{}, last_s{};
    std::optional<double> acked_s{};  ///< accepted, and not seen to be done yet
  };
  /// An answer names its command's kind only: the oldest of that kind that was sent is the one it answers.
  struct Sent {
    int command{};
    std::uint64_t number{};
    double at_s{};
  };
  struct TakeOff {
    std::uint64_t number{};
    double above_ground_m{}, from_m{};
    enum class Stage : std::uint8_t { mode, arm, climb } stage{Stage::mode};
    double stage_s{};
    bool told{false}, armed_here{false};
    std::optional<double> refused_s{}, risen_s{};
    std::string refusal;
  };
  struct Target {
    std::uint64_t number{};
    mavlink::Message message;
    double lat_deg{}, lon_deg{}, height_m{}, begun_s{}, sent_s{}, from_m{};
    bool confirmed{false}, given_up{false};
  };
  /// A mode that was acknowledged and did not come in its time: perhaps it comes yet.
  struct Late {
    std::uint32_t mode{};
    std::uint64_t number{};
    std::string what;
    bool part{false};
    double until_s{};
  };
  /// Of one flight, and gone with it.
  struct Flight {
    double speed_mps{};
    bool taken_over{false};
    std::optional<std::uint32_t> wanted{};  ///< the mode that was commanded last
    bool ours{false};                       ///< `wanted` was commanded, not found
    bool reached{false};
    std::optional<std::uint32_t> former{};  ///< shown when it was commanded
    bool former_ours{false};                ///< and commanded itself
    std::optional<Late> late{};
    std::optional<double> acked_s{};          ///< the command for it was accepted
    std::map<std::uint32_t, double> passing;  ///< modes commanded before, and until when they may show
    bool speed_due{false};
    std::optional<TakeOff> take_off;
    std::optional<Target> target;
  };
  struct Transfer {
    std::uint64_t number{};
    bool up{false};
    ItemList list{};
    std::vector<MissionItem> items;
    std::size_t count{}, next{};
    double last_s{};
    int tries{0};
    bool check{false};                  ///< of an upload: is read back
    std::vector<MissionItem> wanted;    ///< of the reading back
    std::vector<std::uint8_t> asked{};  ///< how often, of each item of an upload
  };

  void handle(const mavlink::Received& in);
  void on_heartbeat(const mavlink::Received& in);
  void on_ack(const mavlink::Message& m);
  void on_transfer(const mavlink::Message& m);
  void on_foreign_transfer(const mavlink::Message& m);
  void lists_lost(const std::string& why);
  void on_answer(Pending& done, std::int64_t result);
  void send(const mavlink::Message& message);
  void send_command(const mavlink::Message& message, int command, std::uint64_t number);
  mavlink::Message command_long(int command, std::initializer_list<double> params) const;
  void command(std::uint64_t number, const std::string& what, int command,
               std::initializer_list<double> params, bool part = false, Proof proof = Proof::answer,
               std::uint32_t mode = 0);
  std::uint64_t mode(const std::string& what, std::uint32_t Dialect::*custom_mode);
  void command_mode(std::uint64_t number, const std::string& what, std::uint32_t custom_mode, bool part);
  void want(std::uint32_t custom_mode);
  void keep_mode(const Pending& lost);
  std::string not_done(const Pending& p) const;
  void confirm_shown();
  bool came_late();
  std::string twins() const;
  void keep_alive();
  void assess_mode();
  void take_over();
  bool deaf(std::uint64_t number, const std::string& what);
  void report(std::uint64_t number, const std::string& what, CommandState state, std::string text);
  std::string said_since(double since_s) const;
  void drive_take_off();
  void next_stage(TakeOff& t, TakeOff::Stage stage);
  void end_take_off(CommandState state, std::string text);
  void drop_target(const std::string& why);
  void drive_target();
  void drive_speed();
  void drive_transfer();
  void next_transfer();
  void replaced(std::uint64_t number, ItemList list);
  void repeat_commands();
  double distance_m(double lat_deg, double lon_deg, double height_m) const;
  mavlink::Message target_message(double lat_deg, double lon_deg, double height_m,
                                  std::optional<double> heading_deg) const;
  mavlink::Message addressed(std::string_view name) const;
  void send_item(std::size_t index);
  void end_transfer(CommandState state, std::string text);

  SessionOptions options_;
  mavlink::Framer framer_;
  mavlink::Packer packer_;
  std::vector<std::uint8_t> out_;
  double now_s_{0}, heartbeat_s_{-10};
  std::optional<double> last_seen_s_;  ///< any message of the vehicle, see keep_alive()
  std::optional<double> beat_s_;       ///< its heartbeat: what mode it is in is as old as that
  mavlink::Address vehicle_{0, 0};
  std::optional<mavlink::Address> expected_;
  Autopilot autopilot_{Autopilot::unknown};
  Telemetry telemetry_;
  std::uint32_t custom_mode_{0};
  std::uint64_t number_{0};
  std::deque<Pending> pending_;
  std::deque<Sent> sent_;
  std::optional<Flight> flight_;
  std::optional<Transfer> transfer_;
  std::map<ItemList, Transfer> waiting_;    ///< uploads, until the running transfer has ended
  std::map<ItemList, std::uint64_t> kept_;  ///< the upload that the autopilot has of each list, read back
  std::vector<MissionItem> items_;
  std::vector<CommandReport> reports_;
};

}  // namespace anchord::drone
