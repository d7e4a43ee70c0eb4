#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::server {

/// Runs a program of /usr/bin with `input` as its standard input: what it printed. It has the limits of this
/// process and no environment, and dies with the calling thread. Blocks until its end.
///
/// cpu_s    processor time of all programs that this process runs, together
/// errors   unsupported (it is not installed), bad_frame (it failed: the last line it complained in),
///          invalid_argument (it printed more than max_output), no_convergence (it used up cpu_s), internal
Result<std::string> run_program(const std::vector<std::string>& command, std::string_view input,
                                std::size_t max_output, int cpu_s);

}  // namespace anchord::server
