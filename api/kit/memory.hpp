#pragma once

namespace anchord::api {

/// After work that needed much memory for a short time: its free pages go back to the system, which the
/// allocator would keep for the next time. Some milliseconds.
void give_back_memory();

}  // namespace anchord::api
