#include "server/runtime/service_manager.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>

namespace anchord::server::service_manager_test {
namespace {

/// The socket a service manager listens on; an abstract name with '@' before it.
class Manager {
 public:
  explicit Manager(const std::string& name) : fd_(::socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, name.data(), name.size());
    if (name.front() == '@') address.sun_path[0] = '\0';
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), size), 0);
    ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  ~Manager() {
    ::unsetenv("NOTIFY_SOCKET");
    ::close(fd_);
  }
  std::string received() const {
    pollfd waiting{fd_, POLLIN, 0};
    if (::poll(&waiting, 1, 5000) != 1) return {};
    char bytes[256];
    const auto n = ::recv(fd_, bytes, sizeof bytes, 0);
    return n < 0 ? std::string() : std::string(bytes, static_cast<std::size_t>(n));
  }

 private:
  int fd_;
};

TEST(ServiceManager, IsToldByPathAndByAbstractName) {
  std::string folder = "/tmp/anchord notify XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  for (const auto& name : {folder + "/socket", "@anchord-test-" + std::to_string(::getpid())}) {
    const Manager manager(name);
    EXPECT_TRUE(notify_service_manager("READY=1\nSTATUS=listening"));
    EXPECT_EQ(manager.received(), "READY=1\nSTATUS=listening");
  }
  ::unlink((folder + "/socket").c_str());
  ::rmdir(folder.c_str());
}

TEST(ServiceManager, IsNotMissedWhereThereIsNone) {
  EXPECT_TRUE(notify_service_manager("READY=1"));
  ::setenv("NOTIFY_SOCKET", "/nowhere/socket", 1);
  EXPECT_FALSE(notify_service_manager("READY=1"));
  ::setenv("NOTIFY_SOCKET", ("/" + std::string(200, 'x')).c_str(), 1);
  EXPECT_FALSE(notify_service_manager("READY=1"));
  ::unsetenv("NOTIFY_SOCKET");
}

}  // namespace
}  // namespace anchord::server::service_manager_test
