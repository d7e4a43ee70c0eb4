#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "core/ports/drone.hpp"
#include "drivers/mavlink/frame.hpp"

namespace anchord::drone {

/// Who on the link is the aircraft. The first autopilot of a multirotor (vehicle_kind.hpp) whose heartbeat is
/// heard is taken, and kept until its
/// heartbeat has been missing for 10 s, its connection was closed, or a person changes it; an aircraft that
/// was armed when it fell silent is followed by its own system id alone. With a key only signed frames count.
/// Everybody else is counted.
///
/// Pure: datagrams (or pieces of a stream, whose sender is "") and time in, a verdict out. Not thread-safe.
class PeerGate {
 public:
  explicit PeerGate(const std::optional<mavlink::Secret>& secret = {});

  /// Whether these bytes are of the aircraft's end of the link.
  bool admits(double now_s, std::int64_t unix_us, const std::string& sender,
              std::span<const std::uint8_t> bytes);
  /// Empty: the next autopilot that is heard.
  void change(const std::string& sender);
  /// The aircraft of a flight that goes on: as if it had been heard now, armed.
  void expect(double now_s, const DroneIdentity& aircraft);
  /// The peer's connection was closed: the aircraft may come by another at once.
  void closed() { last_seen_s_ = -1e9; }

  const std::optional<std::string>& peer() const { return peer_; }
  const mavlink::Address& vehicle() const { return vehicle_; }
  std::vector<OtherOnLink> others(double now_s) const;
  std::uint64_t frames_refused() const { return refused_; }
  /// Why nobody is followed although somebody was heard within 5 s: a vehicle of another kind, or frames
  /// whose signature is refused; empty: nothing known. `connected`: the aircraft is heard, and only what it
  /// says of itself counts.
  std::string trouble(double now_s, bool connected) const;

 private:
  struct Seen {
    std::string kind;
    std::uint64_t frames{};
    double last_s{};
  };
  using Who = std::tuple<std::string, int, int>;

  std::vector<mavlink::Received> read(mavlink::Framer& framer, const std::string& sender, double now_s,
                                      std::span<const std::uint8_t> bytes);
  void note(const std::string& sender, mavlink::Address from, const std::string& kind, double now_s);
  bool may_take(const mavlink::Received& heartbeat, const std::string& sender, double now_s) const;

  std::shared_ptr<mavlink::SignatureBook> book_;
  mavlink::Framer stranger_, stream_;  ///< a datagram of anybody; the aircraft's own bytes, in order
  std::optional<std::string> peer_, wanted_;
  mavlink::Address vehicle_{0, 0};
  bool armed_{false};
  double last_seen_s_{0};
  std::uint64_t refused_{0};
  std::map<Who, Seen> others_;
};

}  // namespace anchord::drone
