#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <variant>

namespace anchord::server {

/// A request target, split and decoded.
struct Target {
  std::string authority;  ///< of an absolute target; else empty
  std::string path;       ///< percent-decoded; "*" for the asterisk form
  std::map<std::string, std::string> query;
};

/// Splits and decodes; the alternative is why not, in words. Refuses: broken percent-encoding, control
/// characters and broken UTF-8 after decoding, an encoded slash, dot segments, a fragment, repeated or
/// nameless query keys, more than `max_parameters`.
std::variant<Target, std::string> split_target(std::string_view target, std::size_t max_parameters);

}  // namespace anchord::server
