#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace anchord::test {

/// A TCP connection that sends exactly the bytes it is told to, and tells what came back and how it ended.
class RawSocket {
 public:
  explicit RawSocket(std::uint16_t port, int receive_buffer = 0) {
    fd_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (receive_buffer > 0) ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~RawSocket() {
    if (fd_ >= 0) ::close(fd_);
  }
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;

  bool connected() const { return connected_; }
  /// False when the server no longer takes it.
  bool send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t n = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (n <= 0) return false;
      bytes.remove_prefix(static_cast<std::size_t>(n));
    }
    return true;
  }
  void half_close() { ::shutdown(fd_, SHUT_WR); }

  /// Reads until `enough(all)` or the end or the deadline; everything read so far stays in `input`.
  template <class Enough>
  bool read_until(Enough enough, std::chrono::milliseconds deadline = std::chrono::seconds(10)) {
    const auto end = std::chrono::steady_clock::now() + deadline;
    while (!enough(input)) {
      if (closed || !read_some(end)) return false;
    }
    return true;
  }
  /// Did the server end the connection within the deadline?
  bool read_to_end(std::chrono::milliseconds deadline = std::chrono::seconds(10)) {
    read_until([](const std::string&) { return false; }, deadline);
    return closed;
  }
  /// One response with Content-Length, taken out of `input`; empty when none came.
  std::string response() {
    std::size_t size = 0;
    const bool whole = read_until([&size](const std::string& all) {
      const auto head = all.find("\r\n\r\n");
      if (head == std::string::npos) return false;
      const auto at = all.find("Content-Length: ");
      size = head + 4;
      if (at != std::string::npos && at < head)
        size += static_cast<std::size_t>(std::stoul(all.substr(at + 16)));
      return all.size() >= size;
    });
    if (!whole) return {};
    std::string one = input.substr(0, size);
    input.erase(0, size);
    return one;
  }

  std::string input;
  bool closed{false};
  int fd() const { return fd_; }

 private:
  bool read_some(std::chrono::steady_clock::time_point end) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    pollfd waiting{fd_, POLLIN, 0};
    if (left.count() <= 0 || ::poll(&waiting, 1, static_cast<int>(left.count())) <= 0) return false;
    char piece[16384];
    const ssize_t n = ::recv(fd_, piece, sizeof piece, 0);
    if (n <= 0) {
      closed = true;
      return false;
    }
    input.append(piece, static_cast<std::size_t>(n));
    return true;
  }

  int fd_{-1};
  bool connected_{false};
};

/// 200 of "HTTP/1.1 200 OK..."; 0 when there is none.
inline int status_of(std::string_view response) {
  if (!response.starts_with("HTTP/1.1 ") || response.size() < 12) return 0;
  return std::stoi(std::string(response.substr(9, 3)));
}

inline std::string body_of(const std::string& response) {
  const auto at = response.find("\r\n\r\n");
  return at == std::string::npos ? std::string{} : response.substr(at + 4);
}

}  // namespace anchord::test
