#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/port/driver.hpp"
#include "drivers/pozyx/tag.hpp"
#include "drivers/time/clock_model.hpp"

namespace anchord::pozyx {

struct UnitOptions {
  std::vector<std::uint16_t> anchors;  ///< to range to, in turn; empty: those a discovery finds
  CirRead cir{CirRead::window};        ///< enough for every feature at a third of the rate's cost of `whole`
  std::optional<UwbSettings> uwb{};    ///< set on opening; absent: as the tag has them
  bool heading{false};                 ///< from the tag's own compass; the autopilot's yaw is better
  double anchor_anchor_s{0};           ///< one range between two anchors every so often; 0: never
};

/// The calibration unit (S1): ranges to every anchor in turn as fast as the link allows, one question at a
/// time; commands of the operator go in between. See device::Driver.
///
/// An anchor that fails five times running is asked only once a second until it answers again, so that the
/// absent do not slow the present. Range.time is the tag's own stamp through its clock model.
class Unit final : public device::Driver {
 public:
  Unit(UnitOptions options, device::DriverOutput& output);
  ~Unit() override;

  void opened(const device::Arrival& now) override;
  void bytes(std::string_view bytes, const device::Arrival& at) override;
  void tick(const device::Arrival& now) override;
  std::optional<std::int64_t> deadline_ns() const override;
  void closed(const device::Arrival& now) override;
  void command(const device::Command& command, const device::Arrival& now) override;

 private:
  struct Anchor {
    int failures{0};
    std::int64_t not_before_ns{0};
  };
  /// Everything of one connection; gone with it.
  struct Session {
    explicit Session(Conversation::Send send) : wire(std::move(send)), tag(wire) {}
    Conversation wire;
    Tag tag;
    ConversationCounters reported{};
    std::optional<Script<int>> script{};
  };

  Script<int> run();
  Script<Result<void>> prepare();
  Script<int> range_next();
  Script<int> range_anchors();
  Script<int> look_around();
  Script<int> execute(device::Command command);
  Script<Result<std::string>> outcome(device::Command command);
  Script<Result<std::string>> get_uwb(std::string arguments);
  Script<Result<std::string>> set_uwb(std::string arguments);
  Script<Result<std::string>> push_positions(std::string arguments);
  Script<Result<std::string>> range_between(std::string arguments);
  Script<Result<std::string>> discover();
  Script<int> adopt(std::vector<std::uint16_t> found);
  Script<Result<std::string>> identify(std::string arguments);
  void emit(const Ranging& ranging, std::uint16_t anchor, const std::optional<CirRecord>& cir,
            std::optional<double> heading_deg);
  void emit_between(const Ranging& ranging, std::uint16_t from, std::uint16_t to);
  bool count(const Ranging& ranging);
  void failed(Anchor& anchor);
  void after();
  UtcTime utc_of(std::int64_t steady_ns);

  UnitOptions options_;
  device::DriverOutput& out_;
  std::unique_ptr<Session> session_;
  std::deque<device::Command> commands_;
  std::optional<std::uint64_t> running_{};  ///< command being executed
  bool rebooting_{false};                   ///< ... is a reboot: its USB port may vanish
  TagIdentity identity_{};
  std::map<std::uint16_t, Anchor> anchors_;
  std::uint16_t newest_anchor_{0};
  std::int64_t look_at_ns_{0}, between_at_ns_{0};
  int looks_{0};  ///< discoveries since anchors were found
  std::size_t between_{0};
  timing::ClockModel clock_{};
  std::optional<timing::Unwrap> unwrap_{};
  bool skewed_{false};
  std::uint64_t seq_{0};
};

/// A unit from its settings: {"anchors": ["0x6a21"], "cir": "none|window|whole", "uwb": {"channel",
/// "rate_kbps", "prf_mhz", "preamble_symbols", "gain_db"}, "heading", "anchor_anchor_s"}, all optional.
/// errors: invalid_argument, naming the option
Result<std::unique_ptr<device::Driver>> make_unit(std::string_view options_json,
                                                  device::DriverOutput& output);

}  // namespace anchord::pozyx
