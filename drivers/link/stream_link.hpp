#pragma once

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <deque>
#include <optional>

#include "drivers/link/byte_link.hpp"

// What the kinds of links share. Included by the .cpp files of this folder alone (Asio is heavy).

namespace anchord::link {

using ErrorCode = boost::system::error_code;
namespace asio = boost::asio;

/// Bounded bytes on their way out. A write is taken whole or refused.
class WriteQueue {
 public:
  explicit WriteQueue(std::size_t bound_bytes) : bound_(bound_bytes) {}
  bool push(std::string_view bytes);
  bool empty() const { return parts_.empty(); }
  const std::string& front() const { return parts_.front(); }
  void pop();
  void clear();

 private:
  std::size_t bound_, bytes_{0};
  std::deque<std::string> parts_;
};

/// Who is called, and no longer called once closed. Shared with the operations in flight, which outlive the
/// link.
struct Shared {
  LinkHandlers handlers;
  LinkCounters counters;
  LinkOptions options;
  bool open{false};
  bool closed{false};
  void opened();
  void took(std::string_view bytes);
  void lost(const Error& why);
};

/// One open descriptor or socket being read and written until it fails. `Stream` is an Asio stream.
template <class Stream>
class Pump : public std::enable_shared_from_this<Pump<Stream>> {
 public:
  using OnEnd = std::function<void(const ErrorCode&, bool wrote_too_long)>;

  Pump(Stream stream, std::shared_ptr<Shared> shared, OnEnd on_end)
      : stream_(std::move(stream)),
        deadline_(stream_.get_executor()),
        shared_(std::move(shared)),
        queue_(shared_->options.write_queue_bytes),
        on_end_(std::move(on_end)) {}

  void start() { read(); }

  Result<void> write(std::string_view bytes) {
    if (ended_) return make_error(Errc::link_lost, "the link is closed");
    const bool idle = queue_.empty();
    if (!queue_.push(bytes)) {
      ++shared_->counters.writes_refused;
      return make_error(Errc::queue_full, "the device does not accept the data that is sent: " +
                                              std::to_string(shared_->options.write_queue_bytes) +
                                              " bytes are waiting");
    }
    if (idle && !queue_.empty()) send();
    return boost::outcome_v2::success();
  }

  void stop() {
    if (std::exchange(ended_, true)) return;
    on_end_ = nullptr;
    shut();
  }

 private:
  void read() {
    stream_.async_read_some(asio::buffer(buffer_),
                            [self = this->shared_from_this()](ErrorCode error, std::size_t n) {
                              if (self->ended_) return;
                              if (n > 0) self->shared_->took({self->buffer_.data(), n});
                              if (self->ended_) return;  // the handler closed us
                              if (error) return self->end(error, false);
                              self->read();
                            });
  }

  void send() {
    deadline_.expires_after(std::chrono::milliseconds(shared_->options.write_deadline_ms));
    deadline_.async_wait([self = this->shared_from_this()](ErrorCode error) {
      if (!error && !self->ended_ && self->deadline_.expiry() <= asio::steady_timer::clock_type::now()) {
        self->end({}, true);
      }
    });
    asio::async_write(stream_, asio::buffer(queue_.front()),
                      [self = this->shared_from_this()](ErrorCode error, std::size_t n) {
                        self->shared_->counters.bytes_out += n;
                        if (self->ended_) return;
                        if (error) return self->end(error, false);
                        self->queue_.pop();
                        if (self->queue_.empty()) {
                          self->deadline_.cancel();
                        } else {
                          self->send();
                        }
                      });
  }

  void end(const ErrorCode& error, bool wrote_too_long) {
    if (std::exchange(ended_, true)) return;
    shut();
    if (const auto call = std::exchange(on_end_, nullptr)) call(error, wrote_too_long);
  }

  void shut() {
    ErrorCode ignored;
    stream_.close(ignored);
    deadline_.cancel();
  }

  Stream stream_;
  asio::steady_timer deadline_;
  std::shared_ptr<Shared> shared_;
  WriteQueue queue_;
  OnEnd on_end_;
  std::array<char, 16 * 1024> buffer_{};
  bool ended_{false};
};

/// Why a stream ended, in one line.
Error ended(const Address& address, const ErrorCode& error, bool wrote_too_long);

std::unique_ptr<ByteLink> make_serial_link(asio::io_context&, const Address&, const LinkOptions&);
std::unique_ptr<ByteLink> make_tcp_link(asio::io_context&, const Address&, const LinkOptions&);
std::unique_ptr<ByteLink> make_listen_link(asio::io_context&, const Address&, const LinkOptions&);
std::unique_ptr<ByteLink> make_udp_link(asio::io_context&, const Address&, const LinkOptions&);

}  // namespace anchord::link
