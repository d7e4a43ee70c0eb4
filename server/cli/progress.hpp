#pragma once

#include <string>

namespace anchord::cli {

/// Progress of a long command on stderr: one line that is written over on a terminal, else a line every ten
/// seconds.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  void show(double fraction);

 private:
  std::string what_;
  bool terminal_;
  double next_s_{0};
  bool shown_{false};
};

/// True once the user pressed Ctrl-C or the process was asked to end; the first call starts listening.
bool interrupted();

}  // namespace anchord::cli
