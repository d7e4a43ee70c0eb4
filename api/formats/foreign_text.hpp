#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// Why a text in UTF-8 is no table of names and rows, and what reads it; empty where it may be one.
std::string no_table(std::string_view text);

/// Takes the line `sep=;` off, by which Excel is told the separator; '\0' where there is none.
char take_separator_line(std::string_view& text);

}  // namespace anchord::api
