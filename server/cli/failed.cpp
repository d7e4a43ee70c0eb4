#include "server/cli/failed.hpp"

#include <cstdio>

#include "core/base/text.hpp"

namespace anchord::cli {

int failed(const char* who, const std::string& message, int code) {
  std::fprintf(stderr, "%s: %s\n", who, printable(message).c_str());
  return code;
}

}  // namespace anchord::cli
