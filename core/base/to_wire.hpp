#pragma once

#include <string>

namespace anchord {

/// Every JSON value that leaves the program (wire, database, file, terminal) is written here and nowhere
/// else: the layering test refuses a bare dump(). Cannot throw on its content: bytes that are not UTF-8
/// become U+FFFD, NaN and infinities become null. A template, so that this folder needs no JSON library;
/// `indent` spaces a level, one line without.
template <class Json>
std::string to_wire(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace anchord
