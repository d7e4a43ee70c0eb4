#pragma once

#include <string>
#include <string_view>

/// Text of strangers for a terminal, beside printable() of core/base/text. Pure; any thread.
namespace anchord::cli {

/// As one line that moves no terminal: as printable(), line ends and tabs as spaces, and what turns the
/// direction of writing or cannot be seen (bidi controls, zero-width spaces) as "?".
std::string one_line(std::string_view text);

/// JSON: what printable() shows as a code, as the escape that JSON has for it.
std::string printable_json(std::string_view json);

}  // namespace anchord::cli
