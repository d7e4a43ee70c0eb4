#pragma once

#include <string>

namespace anchord::cli {

/// Prints "who: message" on the error stream. returns  the exit code of a command (commands.hpp)
int failed(const char* who, const std::string& message, int code = 1);

}  // namespace anchord::cli
