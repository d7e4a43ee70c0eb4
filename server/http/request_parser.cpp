#include "server/http/request_parser.hpp"

#include <boost/beast/http/buffer_body.hpp>
#include <boost/beast/http/parser.hpp>

namespace anchord::server {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;

struct RequestParser::State {
  http::request_parser<http::buffer_body> parser;
  ParsedHead head;
  std::size_t extension_bytes{0}, max_extension_bytes{0}, max_line_bytes{0};
  std::function<void(std::uint64_t, beast::string_view, beast::error_code&)> on_chunk;
};

RequestParser::RequestParser(const HttpLimits& limits) : state_(std::make_unique<State>()) {
  auto& s = *state_;
  s.max_extension_bytes = limits.chunk_extension_bytes;
  s.max_line_bytes = limits.head_bytes;
  s.parser.header_limit(static_cast<std::uint32_t>(limits.head_bytes + 1));
  s.parser.body_limit(boost::none);  // the session counts against the limit of the route
  s.on_chunk = [&s](std::uint64_t, beast::string_view extensions, beast::error_code& error) {
    s.extension_bytes += extensions.size();
    if (s.extension_bytes > s.max_extension_bytes) error = http::error::header_limit;
  };
  s.parser.on_chunk_header(s.on_chunk);
}

RequestParser::~RequestParser() = default;

std::optional<Refusal> RequestParser::parse_head(std::string_view raw) {
  auto& s = *state_;
  beast::error_code error;
  const std::size_t used = s.parser.put(asio::buffer(raw.data(), raw.size()), error);
  if (error == http::error::bad_version) return Refusal{505, "malformed", "only HTTP/1.0 and HTTP/1.1"};
  if (error && error != http::error::need_more) return Refusal{400, "malformed", error.message()};
  if (!s.parser.is_header_done() || used != raw.size())
    return Refusal{400, "malformed", "broken request head"};
  const auto& message = s.parser.get();
  s.head.raw = raw;
  s.head.method = {message.method_string().data(), message.method_string().size()};
  s.head.target = {message.target().data(), message.target().size()};
  s.head.version = message.version();
  for (const auto& field : message) {
    s.head.fields.emplace_back(std::string_view{field.name_string().data(), field.name_string().size()},
                               std::string_view{field.value().data(), field.value().size()});
  }
  return std::nullopt;
}

const ParsedHead& RequestParser::head() const { return state_->head; }
bool RequestParser::done() const { return state_->parser.is_done(); }

RequestParser::Step RequestParser::decode(std::string_view in, std::span<char> out) {
  auto& parser = state_->parser;
  Step step;
  auto& body = parser.get().body();
  body.data = out.data();
  body.size = out.size();
  body.more = true;
  while (!parser.is_done()) {
    beast::error_code error;
    const auto rest = in.substr(step.consumed);
    if (rest.empty()) {
      step.needs_input = true;
      break;
    }
    const std::size_t used = parser.put(asio::buffer(rest.data(), rest.size()), error);
    step.consumed += used;
    if (error == http::error::need_buffer) break;
    if (error == http::error::need_more) {
      // A chunk's line, or the trailers, that do not end.
      if (in.size() - step.consumed > state_->max_line_bytes) {
        step.refusal = Refusal{400, "malformed", "chunk line too long"};
      }
      step.needs_input = true;
      break;
    }
    if (error == http::error::header_limit) {
      step.refusal = Refusal{400, "malformed", "chunk extensions too long"};
      break;
    }
    if (error) {
      step.refusal = Refusal{400, "malformed", error.message()};
      break;
    }
    if (body.size == 0) break;
  }
  step.produced = out.size() - body.size;
  body.data = nullptr;
  body.size = 0;
  step.done = parser.is_done();
  return step;
}

}  // namespace anchord::server
