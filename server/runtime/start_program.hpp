#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::server {

struct ProgramStart {
  std::filesystem::path program;
  std::vector<std::string> arguments;    ///< its own name first
  std::vector<std::string> environment;  ///< "NAME=value", and nothing else
  std::optional<int> input{};            ///< what it reads as standard input; absent: nothing
  bool keep_stderr{false};               ///< its complaints go where ours do
  bool own_group{false};                 ///< leads a process group: all of its processes end with it
};

/// Starts a program that writes nothing to our standard output, with every signal free (the server blocks its
/// own in all threads) and no other open file: its process id. errors: internal, with the system's reason
Result<int> start_program(const ProgramStart& start);

}  // namespace anchord::server
