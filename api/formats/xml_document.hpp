#pragma once

#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace pugi {
class xml_document;
class xml_node;
}  // namespace pugi

namespace anchord::api {

/// A document of a person's map program, by pugixml. It has one element; there are at most 64 levels and
/// 200 000 elements. Document types, with what they can define, are refused, and so are zero bytes; bytes are
/// UTF-8, whatever the declaration says.
/// errors  invalid_argument, naming the line
Result<void> read_xml(std::string_view text, pugi::xml_document& document);

/// Without a prefix.
std::string_view local_name(const pugi::xml_node& node);
/// The first child of this name without its prefix; null where there is none.
pugi::xml_node child_of(const pugi::xml_node& node, std::string_view name);
/// What stands directly in it, less white space at its ends; UTF-8, whatever references in it named.
std::string text_of(const pugi::xml_node& node);
/// Of that child; empty where there is none.
std::string child_text(const pugi::xml_node& node, std::string_view name);

}  // namespace anchord::api
