#pragma once

#include <string>

#include "api/kit/message.hpp"

namespace anchord {
class AccessStore;
class Clock;
}  // namespace anchord

namespace anchord::api {

/// The audit log as routes write it: who did what from where. An answer that could not be audited is a 5xx.
class Audit {
 public:
  /// prompt  takes at once what it writes soon (PromptAccessStore). All must outlive it.
  Audit(AccessStore& store, AccessStore& prompt, const Clock& clock)
      : store_(store), prompt_(prompt), clock_(clock) {}
  /// One line.
  void operator()(const Request& request, std::string what, std::string result = "ok") const;
  /// The same of a command, which was given already and whose answer waits for the disk only a moment.
  void soon(const Request& request, std::string what, std::string result = "ok") const;

 private:
  AccessStore& store_;
  AccessStore& prompt_;
  const Clock& clock_;
};

}  // namespace anchord::api
