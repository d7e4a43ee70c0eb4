#include "drivers/link/serial_port.hpp"

#include <fcntl.h>
#include <grp.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>

#include "core/base/text.hpp"

namespace anchord::link {
namespace {

struct Baud {
  int rate;
  speed_t code;
};
constexpr std::array k_bauds{Baud{1200, B1200},       Baud{2400, B2400},       Baud{4800, B4800},
                             Baud{9600, B9600},       Baud{19200, B19200},     Baud{38400, B38400},
                             Baud{57600, B57600},     Baud{115200, B115200},   Baud{230400, B230400},
                             Baud{460800, B460800},   Baud{500000, B500000},   Baud{576000, B576000},
                             Baud{921600, B921600},   Baud{1000000, B1000000}, Baud{1152000, B1152000},
                             Baud{1500000, B1500000}, Baud{2000000, B2000000}, Baud{2500000, B2500000},
                             Baud{3000000, B3000000}, Baud{3500000, B3500000}, Baud{4000000, B4000000}};

/// "dialout" of a port that only its group may open.
std::string group_of(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return "dialout";
  std::array<char, 4096> buffer{};
  struct group entry {};
  struct group* found = nullptr;
  if (::getgrgid_r(info.st_gid, &entry, buffer.data(), buffer.size(), &found) != 0 || found == nullptr) {
    return std::to_string(info.st_gid);
  }
  return found->gr_name;
}

Error explained(const std::string& path, int error) {
  switch (error) {
    case EACCES:
    case EPERM: {
      const auto group = group_of(path);
      return make_error(Errc::conflict, path + ": permission denied: it belongs to group " + group +
                                            "; run \"sudo usermod -aG " + group +
                                            " $USER\" and log in again");
    }
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return make_error(Errc::not_found, path + ": no such device: is it plugged in and powered?");
    case EBUSY:
    case EWOULDBLOCK:
      return make_error(Errc::conflict, path + ": busy: another program has this port open");
    case ENOTTY:
    case EISDIR:
      return make_error(Errc::invalid_argument, path + ": this is not a serial port");
    default:
      return make_error(Errc::link_lost, path + ": " + std::strerror(error));
  }
}

/// Opening alone makes some devices act (a watchdog resets the machine), and an address may come from whoever
/// may set up devices: only what the system calls a terminal line is opened.
bool terminal_line(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0 || !S_ISCHR(info.st_mode)) return false;
  const unsigned kind = major(info.st_rdev);
  if (kind >= 136 && kind <= 143) return true;  // pseudo terminals (Linux, devices.txt); not in sysfs
  std::error_code error;
  const auto subsystem = std::filesystem::read_symlink(
      "/sys/dev/char/" + std::to_string(kind) + ":" + std::to_string(minor(info.st_rdev)) + "/subsystem",
      error);
  // Without sysfs: ttyS, ttyACM, ttyUSB, ttyAMA.
  if (error) return kind == 4 || kind == 166 || kind == 188 || kind == 204;
  return subsystem.filename() == "tty";
}

/// 0, or the errno that says what went wrong.
int prepare(int fd, speed_t speed) {
  if (::isatty(fd) == 0) return ENOTTY;
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0) return errno;
  if (::ioctl(fd, TIOCEXCL) != 0) return errno;
  struct termios settings {};
  if (::tcgetattr(fd, &settings) != 0) return errno;
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | PARENB | CRTSCTS);
  settings.c_cc[VMIN] = 1;
  settings.c_cc[VTIME] = 0;
  if (::cfsetispeed(&settings, speed) != 0 || ::cfsetospeed(&settings, speed) != 0) return errno;
  if (::tcsetattr(fd, TCSANOW, &settings) != 0) return errno;
  // What waited in the driver since before we came has no honest arrival time.
  if (::tcflush(fd, TCIFLUSH) != 0) return errno;
  return 0;
}

}  // namespace

Result<int> open_serial(const std::string& path, int baud) {
  const auto known =
      std::find_if(k_bauds.begin(), k_bauds.end(), [&](const Baud& b) { return b.rate == baud; });
  if (known == k_bauds.end()) {
    return make_error(Errc::invalid_argument,
                      path + ": " + std::to_string(baud) + " baud is not a supported rate");
  }
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return explained(path, errno);
  if (!terminal_line(path)) return explained(path, ENOTTY);
  const int fd = ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return explained(path, errno);
  if (const int error = prepare(fd, known->code); error != 0) {
    ::close(fd);
    return explained(path, error);
  }
  return fd;
}

std::vector<SerialPort> list_serial_ports(const std::string& by_id_folder, const std::string& dev_folder) {
  namespace fs = std::filesystem;
  std::vector<SerialPort> out;
  std::set<std::string> seen;
  std::error_code error;
  for (fs::directory_iterator it(by_id_folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code gone;  // pulled while we look
    const auto device = fs::canonical(it->path(), gone);
    if (gone || !seen.insert(device.string()).second) continue;
    // A maker's name that is not UTF-8 could not come back as an address: such a port goes by its device.
    const auto path = it->path().string();
    out.push_back(
        {is_utf8(path) ? path : device.string(), device.string(), to_utf8(it->path().filename().string())});
  }
  for (fs::directory_iterator it(dev_folder, error), end; !error && it != end; it.increment(error)) {
    const auto name = it->path().filename().string();
    if (!name.starts_with("ttyACM") && !name.starts_with("ttyUSB")) continue;
    if (seen.insert(it->path().string()).second)
      out.push_back({it->path().string(), it->path().string(), {}});
  }
  std::sort(out.begin(), out.end(), [](const SerialPort& a, const SerialPort& b) {
    return std::tuple(a.id.empty(), a.path) < std::tuple(b.id.empty(), b.path);
  });
  return out;
}

Result<std::uint64_t> device_number(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return explained(path, errno);
  return static_cast<std::uint64_t>(info.st_rdev != 0 ? info.st_rdev : info.st_ino);
}

}  // namespace anchord::link
