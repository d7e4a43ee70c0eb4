#pragma once

#include <string_view>

namespace anchord::server {

/// Tells the service manager that started this process (systemd, Type=notify) what state it is in: "READY=1",
/// "STOPPING=1". Nothing when NOTIFY_SOCKET is not set. False: there is one, and it was not reached.
bool notify_service_manager(std::string_view state);

}  // namespace anchord::server
