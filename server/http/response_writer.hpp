#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"

namespace anchord::server {

enum class BodyCoding : std::uint8_t { length, chunked, until_close };

/// Status line and headers, ended by the empty line. Adds what every answer carries (security headers,
/// no-store where nothing else was said, Date, Content-Length or Transfer-Encoding, Connection,
/// X-Request-Id). Never a banner. `keep_alive_header`: HTTP/1.0 clients must be told.
std::string response_head(const api::Response& response, std::string_view request_id, BodyCoding coding,
                          std::uint64_t content_length, bool keep_alive, bool keep_alive_header);

/// Compresses the answer when the client takes gzip and it pays; sets Vary. Streams are compressed as they
/// go.
void gzip_response(api::Response& response, std::string_view accept_encoding, std::size_t from_bytes);

/// Does an Accept-Encoding header take this coding (q above 0)? Used for pre-compressed files too.
bool accepts_coding(std::string_view accept_encoding, std::string_view coding);

std::string_view reason_phrase(int status);

}  // namespace anchord::server
