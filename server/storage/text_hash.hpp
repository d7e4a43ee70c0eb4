#pragma once

#include <functional>
#include <string_view>

namespace anchord {

/// Finds a text among kept statements without a copy of it.
struct TextHash {
  using is_transparent = void;
  std::size_t operator()(std::string_view text) const { return std::hash<std::string_view>{}(text); }
};

}  // namespace anchord
