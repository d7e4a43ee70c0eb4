#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/time.hpp"

namespace anchord::api {

/// Name and content.
using SupportFile = std::pair<std::string, std::string>;

/// Text with what opens doors left out: user names and passwords in addresses, bearer tokens, 64 hexadecimal
/// digits (tokens and keys of this server), and values of members that are called password, secret, token or
/// key. What is cut reads "(left out)".
std::string without_secrets(std::string_view text);

/// A tar archive (POSIX ustar) of plain files. Names of at most 99 bytes; contents below 8 GiB.
std::string tar_of(const std::vector<SupportFile>& files, UtcTime at);

}  // namespace anchord::api
