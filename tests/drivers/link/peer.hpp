#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "drivers/link/byte_link.hpp"

namespace anchord::link::test {

/// Runs the loop until the condition holds; false when 10 s pass first.
inline bool run_until(boost::asio::io_context& io, const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  io.restart();
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    io.run_one_for(std::chrono::milliseconds(10));
    if (io.stopped()) io.restart();
  }
  return true;
}

/// A link and what came from it.
struct Seen {
  explicit Seen(std::unique_ptr<ByteLink> made) : link(std::move(made)) {
    link->open({[this] { ++opens; },
                [this](std::string_view bytes, const Arrival& at) {
                  text += bytes;
                  last = at;
                },
                [this](const Error& error) { why = error; }});
  }
  std::unique_ptr<ByteLink> link;
  int opens{0};
  std::string text;
  Arrival last{};
  std::optional<Error> why;
};

inline Seen open(boost::asio::io_context& io, const std::string& address, const LinkOptions& options = {}) {
  return Seen(make_link(io, parse_address(address).value(), options));
}

}  // namespace anchord::link::test
