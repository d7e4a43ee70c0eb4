#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace anchord {

/// What an MQTT broker keeps of this server under one topic. Always retained.
struct BrokerMessage {
  std::string topic;
  std::string payload;        ///< JSON; empty: the broker forgets the topic
  bool at_least_once{false};  ///< QoS 1, else 0
};

/// What is published. Called on the broker's thread alone, which may wait for the disk.
class BrokerSource {
 public:
  virtual ~BrokerSource() = default;
  /// What changed since the call before; `everything`: all there is, for a connection that was just made.
  virtual std::vector<BrokerMessage> changes(bool everything) = 0;
  /// Says that this server is there, or is gone: the latter is also its last will.
  virtual BrokerMessage presence(bool online) = 0;
};

struct BrokerStatus {
  bool connected{false};
  std::string address;  ///< host:port
  bool tls{false};
  std::string reason;  ///< why it is not connected; empty: it is
  double in_state_s{0};
  std::uint64_t messages{0};  ///< handed to the broker
  std::uint64_t connections{0}, failures{0};
};

/// One MQTT broker, notified of what a source has. Nothing waits for it: twice a second the newest state of
/// the source is asked for, and only once the messages of before have left, so that a slow broker skips
/// states and none ever queue. Thread-safe.
class Broker {
 public:
  virtual ~Broker() = default;
  /// Once. The source outlives stop().
  virtual void start(BrokerSource& source) = 0;
  virtual BrokerStatus status() const = 0;
  /// Publishes that this server is gone, and disconnects; within a second.
  virtual void stop() = 0;
};

}  // namespace anchord
