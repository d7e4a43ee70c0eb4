#include "server/http/response_writer.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <boost/beast/http/status.hpp>
#include <ctime>
#include <memory>
#include <stdexcept>

#include "server/http/text.hpp"

namespace anchord::server {
namespace {

constexpr std::string_view k_content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
    "connect-src 'self'; worker-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

bool has(const api::Response& response, std::string_view name) {
  return std::ranges::any_of(response.headers, [&](const auto& h) { return iequals(h.first, name); });
}

std::string_view value(const api::Response& response, std::string_view name) {
  for (const auto& [key, text] : response.headers) {
    if (iequals(key, name)) return text;
  }
  return {};
}

/// A value may hold what a client sent (a Location, an ETag): it must not begin a header of its own.
void add(std::string& head, std::string_view name, std::string_view text) {
  head.append(name).append(": ");
  const std::size_t from = head.size();
  head.append(text);
  for (std::size_t i = from; i < head.size(); ++i) {
    if (static_cast<unsigned char>(head[i]) < 0x20 && head[i] != '\t') head[i] = ' ';
  }
  head.append("\r\n");
}

/// Fields that may come more than once: lists, and the one that is none (RFC 9110, 5.2 and 5.3).
bool may_repeat(std::string_view name) {
  return iequals(name, "set-cookie") || iequals(name, "link") || iequals(name, "vary");
}

/// A later value replaces this one: clients join what comes twice, and "1, 1" is no number of seconds.
bool replaced(const api::Response& response, std::size_t i) {
  const auto& name = response.headers[i].first;
  return !may_repeat(name) &&
         std::any_of(response.headers.begin() + static_cast<std::ptrdiff_t>(i) + 1, response.headers.end(),
                     [&](const auto& later) { return iequals(later.first, name); });
}

std::string http_date_of(std::time_t now) {
  std::tm utc{};
  gmtime_r(&now, &utc);
  static constexpr std::array k_day = {"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  static constexpr std::array k_month = {"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                         "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  std::array<char, 64> text{};
  const int n = std::snprintf(text.data(), text.size(), "%s, %02d %s %04d %02d:%02d:%02d GMT",
                              k_day.at(static_cast<std::size_t>(utc.tm_wday)), utc.tm_mday,
                              k_month.at(static_cast<std::size_t>(utc.tm_mon)), utc.tm_year + 1900,
                              utc.tm_hour, utc.tm_min, utc.tm_sec);
  return {text.data(), static_cast<std::size_t>(std::max(n, 0))};
}

/// Written once a second.
std::string_view http_date() {
  thread_local std::time_t written_s = 0;
  thread_local std::string text;
  const std::time_t now_s = std::time(nullptr);
  if (text.empty() || now_s != written_s) {
    text = http_date_of(now_s);
    written_s = now_s;
  }
  return text;
}

/// zlib as a value: bytes in, gzip bytes out.
class Gzip {
 public:
  Gzip() {
    // Level 4: half the time of 6 for a few percent of JSON's size. 15 + 16 asks for the gzip wrapper.
    if (deflateInit2(&stream_, 4, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
      throw std::runtime_error("zlib cannot start");
    }
  }
  ~Gzip() { deflateEnd(&stream_); }
  Gzip(const Gzip&) = delete;
  Gzip& operator=(const Gzip&) = delete;

  std::string put(std::string_view bytes, bool last) {
    std::string out;
    std::array<char, 16 * 1024> piece;
    // zlib's interface lacks const; it does not write to its input.
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream_.avail_in = static_cast<uInt>(bytes.size());
    int result = Z_OK;
    do {
      stream_.next_out = reinterpret_cast<Bytef*>(piece.data());
      stream_.avail_out = static_cast<uInt>(piece.size());
      result = deflate(&stream_, last ? Z_FINISH : Z_NO_FLUSH);
      out.append(piece.data(), piece.size() - stream_.avail_out);
    } while (stream_.avail_out == 0 || (last && result == Z_OK));
    return out;
  }

 private:
  z_stream stream_{};
};

bool compressible(std::string_view type) {
  return type.starts_with("text/") || type.find("json") != std::string_view::npos ||
         type.find("xml") != std::string_view::npos || type.find("javascript") != std::string_view::npos;
}

}  // namespace

bool accepts_coding(std::string_view accept_encoding, std::string_view coding) {
  for (const auto item : split(accept_encoding, ',')) {
    const auto parts = split(item, ';');
    if (!iequals(trim(parts[0]), coding)) continue;
    for (const auto parameter : parts) {
      const auto text = trim(parameter);
      if (text.starts_with("q=0") && text.find_first_of("123456789") == std::string_view::npos) return false;
    }
    return true;
  }
  return false;
}

void gzip_response(api::Response& response, std::string_view accept_encoding, std::size_t from_bytes) {
  if (response.status < 200 || response.status == 204 || response.status == 206 || response.status == 304)
    return;
  if (has(response, "content-encoding") || !compressible(value(response, "content-type"))) return;
  if (!response.body_stream && response.body.size() <= from_bytes) return;
  response.header("Vary", "Accept-Encoding");
  if (!accepts_coding(accept_encoding, "gzip")) return;
  if (response.body_stream) {
    response.body_stream = [source = std::move(response.body_stream), gzip = std::make_shared<Gzip>(),
                            ended = false]() mutable -> std::string {
      std::string out;
      while (out.empty() && !ended) {
        const std::string piece = source();
        ended = piece.empty();
        out = gzip->put(piece, ended);
      }
      return out;
    };
  } else {
    response.body = Gzip().put(response.body, true);
  }
  response.header("Content-Encoding", "gzip");
}

std::string response_head(const api::Response& response, std::string_view request_id, BodyCoding coding,
                          std::uint64_t content_length, bool keep_alive, bool keep_alive_header) {
  std::string head;
  head.reserve(1024);
  head.append("HTTP/1.1 ").append(std::to_string(response.status)).append(" ");
  head.append(reason_phrase(response.status)).append("\r\n");
  for (std::size_t i = 0; i < response.headers.size(); ++i) {
    const auto& [name, text] = response.headers[i];
    if (!iequals(name, "connection") && !replaced(response, i)) add(head, name, text);  // ours to say
  }
  add(head, "Date", http_date());
  if (!request_id.empty() && !has(response, "x-request-id")) add(head, "X-Request-Id", request_id);
  if (!has(response, "content-security-policy"))
    add(head, "Content-Security-Policy", k_content_security_policy);
  add(head, "X-Content-Type-Options", "nosniff");
  add(head, "Referrer-Policy", "no-referrer");
  add(head, "X-Frame-Options", "DENY");  // for browsers that know no frame-ancestors
  if (!has(response, "cache-control")) add(head, "Cache-Control", "no-store");
  const bool bodiless = response.status == 204 || response.status == 304 || response.status < 200;
  if (!bodiless) {
    if (coding == BodyCoding::length) add(head, "Content-Length", std::to_string(content_length));
    if (coding == BodyCoding::chunked) add(head, "Transfer-Encoding", "chunked");
  }
  if (!keep_alive) {
    add(head, "Connection", "close");
  } else if (keep_alive_header) {
    add(head, "Connection", "keep-alive");
  }
  head.append("\r\n");
  return head;
}

std::string_view reason_phrase(int status) {
  namespace http = boost::beast::http;
  const auto phrase = http::obsolete_reason(http::int_to_status(static_cast<unsigned>(status)));
  return {phrase.data(), phrase.size()};
}

}  // namespace anchord::server
