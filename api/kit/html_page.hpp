#pragma once

#include <string>
#include <utility>

#include "api/kit/message.hpp"

namespace anchord::api {

/// A page that is read and nothing else: no script may run in it, nothing is fetched, its own style is all it
/// has.
inline Response html_page(std::string body) {
  Response response;
  response.header("Content-Type", "text/html; charset=utf-8");
  response.header("Content-Security-Policy",
                  "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
                  "frame-ancestors 'none'");
  response.body = std::move(body);
  return response;
}

}  // namespace anchord::api
