#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>

namespace anchord::test {

/// A port of loopback that nobody has at this moment.
inline int free_tcp_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  ::bind(fd, reinterpret_cast<const sockaddr*>(&at), size);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&at), &size);
  ::close(fd);
  return ntohs(at.sin_port);
}

/// True as soon as the condition is, false after 20 s without.
template <class Condition>
bool eventually(const Condition& holds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  do {
    if (holds()) return true;
    std::this_thread::yield();
  } while (std::chrono::steady_clock::now() < end);
  return false;
}

/// Output of a command line, both streams.
inline std::string output_of(const std::string& line) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen((line + " 2>&1").c_str(), "r"), ::pclose);
  std::string out;
  std::array<char, 4096> part{};
  while (pipe && std::fgets(part.data(), part.size(), pipe.get()) != nullptr) out += part.data();
  return out;
}

/// A real Eclipse Mosquitto on loopback that keeps nothing on disk. `more`: lines of its configuration.
class Mosquitto {
 public:
  static constexpr const char* k_program = "/usr/sbin/mosquitto";
  static bool installed() { return ::access(k_program, X_OK) == 0; }

  explicit Mosquitto(std::string more = "allow_anonymous true\n")
      : port_(free_tcp_port()), more_(std::move(more)) {
    char path[] = "/tmp/anchord_mqtt_XXXXXX";
    if (::mkdtemp(path) != nullptr) folder_ = path;
  }
  ~Mosquitto() {
    kill_now();
    std::filesystem::remove_all(folder_);
  }
  Mosquitto(const Mosquitto&) = delete;
  Mosquitto& operator=(const Mosquitto&) = delete;

  /// Whether it answers; the same port every time.
  bool start() {
    const auto file = folder_ / "mosquitto.conf";
    // As root it would become the user mosquitto, who may not read the test's certificates.
    std::ofstream(file) << "listener " << port_ << " 127.0.0.1\npersistence false\n"
                        << (::geteuid() == 0 ? "user root\n" : "") << more_;
    const std::string log = folder_ / "log";
    pid_ = ::fork();
    if (pid_ == 0) {
      if (std::freopen(log.c_str(), "w", stderr) != nullptr)
        ::execl(k_program, "mosquitto", "-c", file.c_str(), static_cast<char*>(nullptr));
      ::_exit(127);
    }
    return eventually([this] {
      const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
      sockaddr_in at{};
      at.sin_family = AF_INET;
      at.sin_port = htons(static_cast<std::uint16_t>(port_));
      at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      const bool open = ::connect(fd, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0;
      ::close(fd);
      return open;
    });
  }
  void signal(int which) const { ::kill(pid_, which); }
  void kill_now() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGCONT);
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  int port() const { return port_; }
  const std::filesystem::path& folder() const { return folder_; }

  /// Payload by topic of the first n messages that a new subscriber gets; of fewer after 10 s.
  std::map<std::string, std::string> read(const std::string& filter, std::size_t n,
                                          const std::string& options = {}) const {
    const auto text =
        output_of("mosquitto_sub -h localhost -p " + std::to_string(port_) + " -q 1 -v -W 10 -C " +
                  std::to_string(n) + " -t '" + filter + "' -F '%r %q %t\t%p' " + options);
    std::map<std::string, std::string> out;
    std::size_t at = 0;
    while (at < text.size()) {
      const auto end = std::min(text.find('\n', at), text.size());
      const auto line = text.substr(at, end - at);
      const auto tab = line.find('\t');
      if (tab != std::string::npos) out[line.substr(4, tab - 4)] = line.substr(tab + 1);
      at = end + 1;
    }
    return out;
  }
  /// The same of one topic as mosquitto_sub prints it: retained, QoS, payload.
  std::string read_one(const std::string& topic) const {
    auto text = output_of("mosquitto_sub -h localhost -p " + std::to_string(port_) +
                          " -q 1 -W 10 -C 1 -F '%r %q %p' -t '" + topic + "'");
    while (text.ends_with('\n')) text.pop_back();
    return text;
  }

 private:
  int port_;
  std::string more_;
  std::filesystem::path folder_;
  pid_t pid_{-1};
};

}  // namespace anchord::test
