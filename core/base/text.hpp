#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace anchord {

/// Well-formed UTF-8 (Unicode table 3-7: no overlong forms, no surrogates, nothing above U+10FFFF).
bool is_utf8(std::string_view bytes);

/// Bytes of a stranger as text: what is not UTF-8 becomes U+FFFD, one for each maximal subpart (Unicode 3.9,
/// "U+FFFD Substitution of Maximal Subparts", what browsers do). Longer than `max_bytes`: cut between
/// characters, never inside one. For the door of a driver or a request: behind it every string is UTF-8.
std::string to_utf8(std::string_view bytes, std::size_t max_bytes = std::string_view::npos);

/// As to_utf8, and control characters (C0, DEL, C1: what moves a terminal's cursor or changes its colours) as
/// \x1b; line ends and tabs stay. For text that is printed on a terminal.
std::string printable(std::string_view bytes);

/// A JSON string with its quotes. Bears any bytes (to_utf8), and no control character leaves it unescaped: a
/// log line stays one line and moves no terminal.
std::string json_text(std::string_view text);
void append_json_text(std::string& out, std::string_view text);

}  // namespace anchord
