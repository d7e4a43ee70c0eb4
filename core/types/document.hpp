#pragma once

#include <string>

namespace anchord {

/// A text that is kept for somebody else: JSON whose shape belongs to the API, which writes it and reads it
/// again. Nothing here or in the store looks into it; it comes back byte for byte. Empty: there is none.
struct Document {
  std::string text;
  bool empty() const { return text.empty(); }
  bool operator==(const Document&) const = default;
};

}  // namespace anchord
