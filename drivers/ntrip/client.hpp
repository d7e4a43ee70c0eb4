#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/ntrip/rtcm.hpp"
#include "drivers/port/driver.hpp"

namespace anchord::ntrip {

struct ClientOptions {
  std::string mount;
  std::string user, password_file;  ///< the password itself is in no setting and in no recording
  int version = 2;                  ///< 1 for old casters that do not understand HTTP/1.1
  bool send_gga = true;             ///< network mounts send nothing before they know where we are
  std::string host;                 ///< for the request's Host line
};

/// Corrections from an NTRIP caster for the rovers: whole RTCM 3 frames, each as soon as its last byte came,
/// and nothing else, since a receiver takes commands on the same wire. Undoes chunks, refuses what is not a
/// stream (source table, web page, refusals, k_most_noise bytes without a frame) with its reason, and tells
/// the caster our rover's position every ten seconds. See device::Driver.
class Client final : public device::Driver {
 public:
  Client(ClientOptions options, device::DriverOutput& output);

  void opened(const device::Arrival& now) override;
  void bytes(std::string_view bytes, const device::Arrival& at) override;
  void tick(const device::Arrival& now) override;
  std::optional<std::int64_t> deadline_ns() const override { return deadline_ns_; }
  void closed(const device::Arrival& now) override;
  void command(const device::Command& command, const device::Arrival& now) override;

 private:
  enum class State : std::uint8_t { closed, status, headers, maybe_headers, table, stream, refused };
  void head(const device::Arrival& at);
  bool status_line(const std::string& line);
  void header_line(const std::string& line);
  void begin_stream(const device::Arrival& at);
  void table_line(const std::string& line);
  void table_end();
  void stream(std::string_view bytes, const device::Arrival& at);
  void hand_on(const device::Arrival& at);
  void judge_noise(std::string_view bytes, int good);
  void unchunk(std::string_view bytes, const device::Arrival& at);
  void refuse(const std::string& why, std::int64_t wait_s);
  /// Every ten seconds of a stream: tells our position, and looks whether anything comes.
  void stream_tick(const device::Arrival& now);

  ClientOptions options_;
  device::DriverOutput& out_;
  State state_{State::closed};
  std::string held_;  ///< of the answer's head or of a chunk's; bounded
  bool chunked_{false}, is_table_{false};
  std::size_t chunk_left_{0};
  std::string mounts_;  ///< of a source table
  RtcmFrames frames_;
  std::uint64_t skipped_{0}, handed_on_{0};  ///< bytes, of this connection
  std::size_t since_frame_{0};               ///< bytes since the last good frame
  std::string noise_;                        ///< its first ones, to say what they are
  double budget_{0};                         ///< bytes that may go to receivers now
  std::int64_t budget_at_ns_{0};
  bool too_many_{false};
  std::optional<std::int64_t> deadline_ns_{};
  std::int64_t stream_since_ns_{0};  ///< since when nothing came: begin of the stream, or its newest frame
  bool silent_{false};
};

/// A GGA sentence of a rover's position with its CR LF.
std::string gga_of(const device::RoverStatus& rover);

}  // namespace anchord::ntrip
