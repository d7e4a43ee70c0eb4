#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/http/request_check.hpp"

namespace anchord::server {

/// One request's parser: head, then body piece by piece. Holds Beast's parser, so that few files compile it.
class RequestParser {
 public:
  explicit RequestParser(const HttpLimits& limits);
  ~RequestParser();
  RequestParser(const RequestParser&) = delete;
  RequestParser& operator=(const RequestParser&) = delete;

  /// `raw` is a whole head, as scan_head found it, and must outlive head().
  std::optional<Refusal> parse_head(std::string_view raw);
  const ParsedHead& head() const;

  struct Step {
    std::size_t consumed{0};  ///< of the input: may be dropped from the buffer
    std::size_t produced{0};  ///< body bytes written to `out`
    bool done{false};         ///< the message has ended; the rest of the input is the next one
    bool needs_input{false};
    std::optional<Refusal> refusal;
  };
  /// Decodes body bytes from `in` (unconsumed input must be offered again, with more behind it).
  Step decode(std::string_view in, std::span<char> out);
  bool done() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::server
