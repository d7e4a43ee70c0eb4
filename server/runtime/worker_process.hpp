#pragma once

#include <filesystem>

#include "api/work/worker_port.hpp"

namespace anchord::server {

/// Heavy work in a process of its own, `anchord worker`, started for one message and ended after it: nice 10,
/// limits on memory and processor time, no network. Its death is an error of the work and nothing else; the
/// death of this process is its own. Cancelled work gets half a second to end by itself, then it is killed.
///
/// program  the anchord binary; default: the one that runs
/// threads  the function may be called from several threads; each call starts one process. The calling thread
///          must live as long as the call.
api::RunWork work_in_process(std::filesystem::path program = "/proc/self/exe");

/// What `anchord worker` does with the socket on its standard input. Returns the exit code.
int worker_main();

}  // namespace anchord::server
