#pragma once

#include <memory>

#include "core/ports/web_post.hpp"

namespace anchord::server {

/// `allow_private`: addresses of this machine and this network may be named too (an integration beside the
/// server).
std::unique_ptr<WebPost> make_web_post(bool allow_private);

}  // namespace anchord::server
