#pragma once

#include <span>
#include <string>

namespace CLI {
class App;
}

namespace anchord::cli {

/// What is wrong with a command line that could not be understood, naming the word and what was probably
/// meant: "there is no command 'sovle'; did you mean 'solve'?". Empty when every word is known.
std::string unknown_word(const CLI::App& app, std::span<const char* const> arguments);

}  // namespace anchord::cli
