#pragma once

#include <cstdint>
#include <string>

namespace anchord::api {

struct BuildInfo {
  std::string version, git, build, compiler;
  std::int64_t schema{0};  ///< of the database
};

}  // namespace anchord::api
