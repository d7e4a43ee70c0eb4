#pragma once

#include <string>
#include <vector>

namespace anchord::device {

struct Candidate {
  std::string address;
  std::string kind;      ///< gnss, pozyx; empty: nothing known spoke
  std::string evidence;  ///< what was heard, or why the port did not open
  bool configured{false};
};

struct DiscoverOptions {
  int listen_ms = 2'500;  ///< receivers speak each second
  std::string by_id_folder = "/dev/serial/by-id", dev_folder = "/dev";
  std::vector<std::string> also{"tcp://127.0.0.1:2947"};  ///< a gpsd on this machine
};

/// Opens every serial port that is not `ours`, listens on all of them at once and tells who spoke what. Runs
/// its own loop; blocks for listen_ms.
std::vector<Candidate> discover(const std::vector<std::string>& ours, const DiscoverOptions& options = {});

}  // namespace anchord::device
