#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "server/runtime/log_line.hpp"
#include "tests/fuzz/check.hpp"

namespace anchord::fuzz {

/// Text that a driver or a request hands on: UTF-8, and a wire and a log line that are what they claim to be.
inline void told(std::string_view text) {
  require(is_utf8(text), "behind the door every text is UTF-8");
  const auto wire = nlohmann::json::parse(json_text(text), nullptr, false);
  require(wire.is_string() && wire.get<std::string>() == text, "a JSON string reads back");
  const auto line = server::log_line(UtcTime{1'700'000'000'000'000'000}, server::LogLevel::info, text,
                                     {{"what", text}, {text, "key"}});
  for (const char c : line) require(static_cast<unsigned char>(c) >= 0x20 && c != 0x7f, "a line is one line");
  require(line.find("\xc2\x9b") == std::string::npos, "no code of a terminal in a line");
  require(nlohmann::json::parse(line, nullptr, false).is_object(), "a log line is one JSON object");
}

/// The same of a value on its way out.
template <class Json>
void told_json(const Json& json) {
  const auto wire = to_wire(json);
  require(is_utf8(wire), "a wire is UTF-8");
  require(!nlohmann::json::parse(wire, nullptr, false).is_discarded(), "a wire is JSON");
}

}  // namespace anchord::fuzz
