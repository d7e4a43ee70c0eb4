#pragma once

#include <malloc.h>

namespace anchord {

/// After work that needed much memory for a short time: its free pages go back to the system, which the
/// allocator would keep for the next time. Some milliseconds.
inline void give_back_memory() { ::malloc_trim(0); }

}  // namespace anchord
