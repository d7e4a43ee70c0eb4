#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "drivers/link/address.hpp"

namespace boost::asio {
class io_context;
}

namespace anchord::link {

/// When bytes arrived, by both clocks: the wall clock may step, the steady one never does.
struct Arrival {
  UtcTime utc{};
  std::int64_t steady_ns{};  ///< CLOCK_MONOTONIC
};
Arrival arrival_now();

struct LinkOptions {
  std::size_t write_queue_bytes = 64 * 1024;  ///< a second of the fastest device; more means it does not read
  std::int64_t open_deadline_ms = 5'000;      ///< resolving and connecting together
  std::int64_t write_deadline_ms = 5'000;     ///< a write that lasts longer closes the link
};

struct LinkCounters {
  std::uint64_t bytes_in{}, bytes_out{}, writes_refused{};
};

/// Called on the thread of the io_context. After close() nothing is called any more.
struct LinkHandlers {
  std::function<void()> on_open{};  ///< bytes can flow; a listening link: each time a peer came
  /// As the operating system hands them: any cut, for UDP one datagram. Valid during the call only.
  std::function<void(std::string_view bytes, const Arrival& at)> on_bytes{};
  /// Once, after which the link is dead and a new one is made: did not open, or was lost. For people, one
  /// line.
  std::function<void(const Error& why)> on_closed{};
  /// UDP, tcp-listen: whether these bytes count, and their sender is who we answer from now on. Absent: the
  /// latest sender is. What is not welcome never reaches on_bytes.
  std::function<bool(std::string_view bytes, const std::string& sender, const Arrival& at)> welcome{};
};

/// A two-way byte stream to one device. Never blocks; every queue is bounded. No clock, no retry: a
/// supervisor decides when to make the next one. All members belong to the thread that runs the io_context.
/// The destructor closes.
class ByteLink {
 public:
  virtual ~ByteLink() = default;
  ByteLink() = default;
  ByteLink(const ByteLink&) = delete;
  ByteLink& operator=(const ByteLink&) = delete;

  /// Once. The outcome comes through the handlers, never from inside this call.
  virtual void open(LinkHandlers handlers) = 0;
  /// All of the bytes or none. errors: queue_full, link_lost (not open, or nobody connected yet)
  virtual Result<void> write(std::string_view bytes) = 0;
  virtual void close() = 0;
  virtual bool is_open() const = 0;
  virtual LinkCounters counters() const = 0;
  /// Listening links: the port the system chose; others: the port of the address. 0 for serial.
  virtual std::uint16_t port() const = 0;
};

std::unique_ptr<ByteLink> make_link(boost::asio::io_context& io, const Address& address,
                                    const LinkOptions& options = {});

}  // namespace anchord::link
