#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/dwm1001/protocol.hpp"
#include "drivers/port/driver.hpp"

namespace anchord::dwm1001 {

enum class Mode : std::uint8_t { shell, tlv };
inline constexpr auto k_mode_words = enum_table<Mode>({{"shell", Mode::shell}, {"tlv", Mode::tlv}});

struct TagOptions {
  Mode mode{Mode::shell};
  std::optional<NetworkId> tag{};  ///< absent: what `si` says; the binary protocol does not say it
};

/// A Qorvo (Decawave) DWM1001 with its PANS firmware as a tag, over UART or USB at 115200 baud: distances of
/// the shell command `les`, or polled in binary (TLV). They have no level and no time: a row is stamped with
/// its arrival, and the lag is the flight's to solve. What cannot be used is counted: bad_line,
/// line_too_long, no_reply, bad_reply, refused, repeated, zero_distance, out_of_reach. See device::Driver.
class Tag final : public device::Driver {
 public:
  Tag(TagOptions options, device::DriverOutput& output) : options_(options), out_(output) {}

  void opened(const device::Arrival& now) override;
  void bytes(std::string_view bytes, const device::Arrival& at) override;
  void tick(const device::Arrival& now) override;
  std::optional<std::int64_t> deadline_ns() const override { return deadline_ns_; }
  void closed(const device::Arrival& now) override;
  void command(const device::Command& command, const device::Arrival& now) override;

 private:
  /// Shell: woken, restarted (a host before may have left `les` on, and the same command would switch it
  /// off), woken again, asked for its id, and then distances come. Binary: always `ranging`.
  enum class State : std::uint8_t { closed, waking, restarting, asking, ranging };
  void line(std::string_view line, const device::Arrival& at);
  void prompt(const device::Arrival& at);
  void location(const device::Arrival& at);
  void begin_les();
  void identify(NetworkId id);
  void emit(const std::vector<Distance>& distances, const device::Arrival& at);

  TagOptions options_;
  device::DriverOutput& out_;
  State state_{State::closed};
  std::string held_;
  bool skip_{false};
  std::optional<NetworkId> id_{};
  std::string newest_;  ///< the binary answer before
  bool asked_{false};   ///< binary: an answer is due
  bool restarted_{false};
  int tries_{0};
  std::optional<std::int64_t> deadline_ns_{};
  std::uint64_t seq_{0};
};

/// {"mode": "shell|tlv", "tag": "0x022e"}. errors: invalid_argument, naming the option
Result<std::unique_ptr<device::Driver>> make_tag(std::string_view options_json, device::DriverOutput& output);

}  // namespace anchord::dwm1001
