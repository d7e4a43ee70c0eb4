#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::link {

/// Opens a serial port or pty raw (8N1, no echo, no flow control), non-blocking and for us alone (TIOCEXCL,
/// and flock for those whom TIOCEXCL does not bind). Returns a descriptor the caller owns. errors: not_found,
/// conflict (port busy), invalid_argument (no tty, baud not supported), link_lost; the message is one line
/// that says what to do.
Result<int> open_serial(const std::string& path, int baud);

/// One port of this machine.
struct SerialPort {
  std::string path;    ///< stable: /dev/serial/by-id/... where udev made one, else the device itself
  std::string device;  ///< what it points at now, e.g. /dev/ttyACM0
  std::string id;      ///< name below by-id, empty without one
};
/// Ports there are now, by-id first, each device once; sorted. Folders as parameters for tests.
std::vector<SerialPort> list_serial_ports(const std::string& by_id_folder = "/dev/serial/by-id",
                                          const std::string& dev_folder = "/dev");

/// The device a path stands for: number of the device node, the same for every link to it. not_found.
Result<std::uint64_t> device_number(const std::string& path);

}  // namespace anchord::link
