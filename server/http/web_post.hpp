#pragma once

#include <memory>
#include <string>

#include "core/ports/web_post.hpp"

namespace anchord::server {

/// `allow_private`: addresses of this machine and this network may be named too (an integration beside the
/// server).
/// ca_file  PEM of the authorities that may sign the receivers' certificates; empty: those of the system
std::unique_ptr<WebPost> make_web_post(bool allow_private, std::string ca_file = {});

}  // namespace anchord::server
