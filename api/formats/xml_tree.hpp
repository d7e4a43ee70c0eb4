#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::api {

/// One element: its name without a prefix, its text, what it contains. Attributes are not kept.
struct XmlNode {
  std::string name, text;
  std::vector<XmlNode> children;

  const XmlNode* child(std::string_view wanted) const;  ///< the first of this name
  std::string_view child_text(std::string_view wanted) const;
};

/// A document of a person's map program. Document types, with what they can define, are refused; so are more
/// than 64 levels and 200 000 elements.
/// errors  invalid_argument, naming the line
Result<XmlNode> parse_xml(std::string_view text);

}  // namespace anchord::api
