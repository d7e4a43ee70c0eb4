#pragma once

namespace anchord::server {

/// From here on this thread, and what it starts, can open the system's programs, libraries and fonts for
/// reading and no other file: neither the database nor a key (Landlock). A kernel without it goes on without:
/// it is one fence of several.
void see_system_files_only();

}  // namespace anchord::server
