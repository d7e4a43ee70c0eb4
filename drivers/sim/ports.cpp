#include "drivers/sim/ports.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <utility>

namespace anchord::sim {
namespace {

constexpr std::size_t k_read = 16'384;

Error failed(const std::string& what) {
  return make_error(Errc::link_lost, what + ": " + std::strerror(errno));
}

/// What can be read now; nothing more to come: false.
bool read_all(int fd, std::string& out) {
  std::array<char, k_read> buffer{};
  for (;;) {
    const auto n = ::read(fd, buffer.data(), buffer.size());
    if (n > 0) {
      out.append(buffer.data(), static_cast<std::size_t>(n));
      if (static_cast<std::size_t>(n) < buffer.size()) return true;
    } else if (n < 0 && errno == EINTR) {
      continue;
    } else {
      return n < 0 && errno == EAGAIN;
    }
  }
}

class Pty final : public Port {
 public:
  explicit Pty(std::string link) : link_(std::move(link)) {}
  ~Pty() override { Pty::down(); }

  Result<void> up() override {
    down();
    master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    if (master_ < 0) return failed("cannot create a pty");
    std::array<char, 128> name{};
    if (::grantpt(master_) != 0 || ::unlockpt(master_) != 0 ||
        ::ptsname_r(master_, name.data(), name.size()) != 0) {
      return failed("cannot create a pty");
    }
    path_ = name.data();
    // Raw from the beginning: no echo of what a host says before it has set its own mode.
    const int slave = ::open(path_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (slave < 0) return failed("cannot open " + path_);
    termios mode{};
    ::tcgetattr(slave, &mode);
    ::cfmakeraw(&mode);
    ::tcsetattr(slave, TCSANOW, &mode);
    ::close(slave);
    if (link_.empty()) return boost::outcome_v2::success();
    std::error_code error;
    // A link of another simulator may be taken over; a device or file of that name is somebody's.
    const auto there = std::filesystem::symlink_status(link_, error);
    if (std::filesystem::exists(there) && !std::filesystem::is_symlink(there))
      return make_error(Errc::conflict, link_ + ": already exists and is not a link");
    error.clear();
    const std::string part = link_ + ".part";
    std::filesystem::remove(part, error);
    std::filesystem::create_symlink(path_, part, error);
    if (!error) std::filesystem::rename(part, link_, error);
    if (error) return make_error(Errc::link_lost, link_ + ": " + error.message());
    return boost::outcome_v2::success();
  }
  void down() override {
    if (master_ < 0) return;
    ::close(std::exchange(master_, -1));
    open_ = false;
    // Another simulator may have taken the link meanwhile.
    std::error_code ignored;
    if (!link_.empty() && std::filesystem::read_symlink(link_, ignored) == path_)
      std::filesystem::remove(link_, ignored);
  }
  bool is_up() const override { return master_ >= 0; }
  std::vector<int> arrived() override {
    if (master_ < 0) return {};
    pollfd look{master_, POLLOUT, 0};
    ::poll(&look, 1, 0);
    const bool was = std::exchange(open_, (look.revents & POLLHUP) == 0);
    return open_ && !was ? std::vector<int>{0} : std::vector<int>{};
  }
  std::vector<Received> receive() override {
    std::string bytes;
    // Also what a host said before it closed the port: it has to be done, and not to be taken for the next
    // host's.
    if (master_ >= 0) read_all(master_, bytes);
    return bytes.empty() ? std::vector<Received>{} : std::vector<Received>{{0, std::move(bytes)}};
  }
  void send(int, std::string_view bytes) override { send_all(bytes); }
  void send_all(std::string_view bytes) override {
    if (master_ < 0 || !open_ || bytes.empty()) return;
    // What the host does not read is lost, as on a cable without flow control.
    while (!bytes.empty()) {
      const auto n = ::write(master_, bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return;
      bytes.remove_prefix(static_cast<std::size_t>(n));
    }
  }
  bool anybody() const override { return open_; }
  std::vector<int> descriptors() const override {
    // With nobody at the other end poll would report the hang-up again and again.
    return master_ >= 0 && open_ ? std::vector<int>{master_} : std::vector<int>{};
  }
  std::string path() const override { return path_; }

 private:
  std::string link_, path_;
  int master_{-1};
  bool open_{false};
};

class Tcp final : public Port {
 public:
  explicit Tcp(std::uint16_t port) : port_(port) {}
  ~Tcp() override { Tcp::down(); }

  Result<void> up() override {
    down();
    listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (listener_ < 0) return failed("cannot create a socket");
    const int yes = 1;
    ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    at.sin_port = htons(port_);
    if (::bind(listener_, reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0 ||
        ::listen(listener_, 8) != 0)
      return make_error(Errc::conflict, "port " + std::to_string(port_) + ": " + std::strerror(errno));
    socklen_t size = sizeof at;
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&at), &size);
    port_ = ntohs(at.sin_port);
    return boost::outcome_v2::success();
  }
  void down() override {
    for (const auto& [peer, fd] : peers_) ::close(fd);
    peers_.clear();
    if (listener_ >= 0) ::close(std::exchange(listener_, -1));
  }
  bool is_up() const override { return listener_ >= 0; }
  std::vector<int> arrived() override {
    std::vector<int> out;
    while (listener_ >= 0) {
      const int fd = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
      if (fd < 0) break;
      const int yes = 1;
      ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
      peers_[next_] = fd;
      out.push_back(next_++);
    }
    return out;
  }
  std::vector<Received> receive() override {
    std::vector<Received> out;
    for (auto at = peers_.begin(); at != peers_.end();) {
      std::string bytes;
      const bool alive = read_all(at->second, bytes);
      if (!bytes.empty()) out.push_back({at->first, std::move(bytes)});
      if (!alive) {
        ::close(at->second);
        at = peers_.erase(at);
      } else {
        ++at;
      }
    }
    return out;
  }
  void send(int peer, std::string_view bytes) override {
    const auto found = peers_.find(peer);
    if (found == peers_.end() || bytes.empty()) return;
    if (const auto n = ::send(found->second, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        n < 0 && errno != EAGAIN) {
      ::close(found->second);
      peers_.erase(found);
    }
  }
  void send_all(std::string_view bytes) override {
    std::vector<int> all;
    for (const auto& [peer, fd] : peers_) all.push_back(peer);
    for (const int peer : all) send(peer, bytes);
  }
  bool anybody() const override { return !peers_.empty(); }
  std::vector<int> descriptors() const override {
    std::vector<int> out;
    if (listener_ >= 0) out.push_back(listener_);
    for (const auto& [peer, fd] : peers_) out.push_back(fd);
    return out;
  }
  std::uint16_t port() const override { return port_; }

 private:
  std::uint16_t port_;
  int listener_{-1}, next_{0};
  std::map<int, int> peers_;  ///< number, descriptor
};

}  // namespace

std::unique_ptr<Port> make_pty(std::string link) { return std::make_unique<Pty>(std::move(link)); }
std::unique_ptr<Port> make_tcp(std::uint16_t port) { return std::make_unique<Tcp>(port); }

}  // namespace anchord::sim
