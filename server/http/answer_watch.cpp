#include "server/http/answer_watch.hpp"

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>

namespace anchord::server {
namespace {

constexpr std::chrono::milliseconds k_look_every{100};
/// Less than this is no link that a flight's bundle ever gets over: GPRS has five times as much. Looked at
/// after so long, or sooner where the answer must begin sooner.
constexpr std::chrono::milliseconds k_window{30'000};
constexpr std::uint64_t k_least_bytes_per_s = 1000;
/// Beside the body, as it came: heads, sizes of chunks, TLS, and what the kernel holds (tcp_rmem: 6 MiB).
constexpr std::uint64_t k_most_beside_body = std::uint64_t{24} << 20;

/// Of a connection, over all its life; 0 where the system does not say.
std::uint64_t received_by(int socket) {
  if (socket < 0) return 0;
  tcp_info info{};
  socklen_t size = sizeof info;
  if (::getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return 0;
  return info.tcpi_bytes_received;
}

}  // namespace

AnswerWatch::AnswerWatch(const std::atomic<int>& socket, Limits limits)
    : socket_(socket), limits_(std::move(limits)) {
  {
    auto call = call_.lock();
    call->socket = socket_;
    call->before = received_by(call->socket);
  }
  thread_ = Thread("anchord-answer", [this] { run(); });
}

AnswerWatch::~AnswerWatch() {
  {
    auto call = call_.lock();
    call->over = true;
  }
  changed_.notify_all();
  thread_.join();
}

void AnswerWatch::sent() {
  auto call = call_.lock();
  call->since = Clock::now();
}

void AnswerWatch::begun() {
  auto call = call_.lock();
  call->begun = true;
  call->since = Clock::now();
}

void AnswerWatch::received(std::uint64_t bytes) {
  auto call = call_.lock();
  call->bytes += bytes;
  call->window_bytes += bytes;
}

std::string AnswerWatch::why() const {
  const auto call = call_.lock();
  return call->why;
}

void AnswerWatch::run() {
  auto call = call_.lock();
  while (!call.wait_for(changed_, k_look_every, [](const Call& one) { return one.over; })) {
    call->why = fault(*call);
    if (call->why.empty()) continue;
    call.unlocked([this] { limits_.stop(); });
    return;
  }
}

std::string AnswerWatch::fault(Call& call) const {
  if (const int socket = socket_; socket != call.socket) {
    call.socket = socket;
    call.before = 0;
  }
  const auto received = received_by(call.socket);
  if (received > call.before + call.bytes + call.bytes / 4 + k_most_beside_body)
    return "sent more than " + std::to_string(k_most_beside_body >> 20) + " MiB that are no answer";
  const auto now = Clock::now();
  if (!call.begun)
    return now > call.since + limits_.head ? std::string("did not answer in time") : std::string();
  const auto window = std::min(k_window, limits_.head);
  if (now < call.since + window) return {};
  const bool slow =
      call.window_bytes * 1000 < k_least_bytes_per_s * static_cast<std::uint64_t>(window.count());
  call.since = now;
  call.window_bytes = 0;
  return slow ? "answers with less than " + std::to_string(k_least_bytes_per_s) + " bytes a second" : "";
}

}  // namespace anchord::server
