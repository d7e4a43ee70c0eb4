#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "core/base/enum_table.hpp"
#include "core/base/steady.hpp"
#include "server/gateway/answer.hpp"
#include "server/gateway/outbox.hpp"

namespace anchord::gateway {

/// How the gateway knows which mission its rows belong to.
enum class MissionFrom : std::uint8_t {
  unassigned,  ///< the server was never asked: rows are kept without a mission
  given,       ///< --mission
  remembered,  ///< of before the restart, a few minutes ago
  server,      ///< the one that has the server's devices
};
inline constexpr auto k_mission_from_words = enum_table<MissionFrom>({{"unassigned", MissionFrom::unassigned},
                                                                      {"given", MissionFrom::given},
                                                                      {"remembered", MissionFrom::remembered},
                                                                      {"server", MissionFrom::server}});

struct SenderOptions {
  std::string url;
  std::filesystem::path token_file;  ///< read at every attempt after trouble; empty: no token is sent
  std::filesystem::path data_dir;    ///< rejected.ndjson is in it
  std::optional<MissionId> mission{};
  /// Rows of the devices are of this mission from now on; absent: they are not kept.
  std::function<void(const std::optional<MissionId>&)> record_into;
  std::function<void(const std::string& text)> log;
};

struct SenderStatus {
  Link link{Link::unknown};
  std::string why;     ///< of a link that is not up
  SteadyTime since{};  ///< of this link
  std::optional<UtcTime> last_answer{}, newest_delivered{};
  double next_try_s{};
  double clock_ahead_s{};  ///< of the server's, by its newest answer; negative: behind
  std::uint64_t requests{}, bytes_sent{};
  double bytes_per_s{};  ///< of the newest requests with rows
  std::optional<MissionId> mission{};
  MissionFrom mission_from{MissionFrom::unassigned};
  std::string mission_problem;            ///< why the mission cannot be asked for
  std::map<MissionId, std::string> held;  ///< missions the server does not know: what it says
};

/// The way to the server, on a thread of its own: newest rows first, and between them the oldest of those
/// that stayed behind, in pieces of about a second of the link (docs/adr/0011-outbox.md).
class Sender {
 public:
  /// errors: invalid_argument (no such address), those of the outbox
  static Result<std::unique_ptr<Sender>> make(Outbox& outbox, SenderOptions options);
  /// stop().
  ~Sender();
  void start();
  /// Within the time-out of a request. Idempotent.
  void stop();
  /// Rows have come. Any thread.
  void rows_came();
  SenderStatus status() const;
  /// 401, 403 and pages of others: what a person must do something about.
  static bool needs_a_person(Link link) { return link == Link::unauthorized || link == Link::refused; }

 private:
  class Impl;
  explicit Sender(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace anchord::gateway
