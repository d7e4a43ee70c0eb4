#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace anchord {

/// Characters (code points) of UTF-8, which is what JSON Schema's maxLength counts.
std::size_t characters_of(std::string_view text);

/// What is wrong with a name, or another line of text that a person gives: the one rule wherever one is read.
enum class LineFault { none, too_long, control_character };
/// max_characters  at most four times as many bytes are let through
LineFault line_fault(std::string_view text, std::size_t max_characters);
/// In words: "must be at most 200 characters"; empty: nothing is wrong.
std::string in_words(LineFault fault, std::size_t max_characters);
/// Nothing, or blanks alone.
inline bool is_blank(std::string_view text) { return text.find_first_not_of(' ') == std::string_view::npos; }

}  // namespace anchord
