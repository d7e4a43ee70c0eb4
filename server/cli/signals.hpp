#pragma once

#include <initializer_list>

namespace anchord::cli {

/// Of a program that serves, before any of its threads starts, so that all inherit it: only wait_for_signal()
/// receives these. A broken pipe and a file size limit are errors of a write, not the end of the program.
void block_signals(std::initializer_list<int> wanted);
/// Number of the first of them that comes.
int wait_for_signal(std::initializer_list<int> wanted);

/// Whether one of them has come that nobody has received yet.
bool signal_waits(std::initializer_list<int> wanted);

}  // namespace anchord::cli
