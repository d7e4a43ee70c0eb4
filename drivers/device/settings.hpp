#pragma once

#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "drivers/port/driver.hpp"

namespace anchord::device {

/// As recordings keep them. errors: bad_frame.
std::string to_json(const Settings& settings);
Result<Settings> parse_settings(std::string_view json);
std::string to_json(const Command& command);
Result<Command> parse_command(std::string_view json);

}  // namespace anchord::device
