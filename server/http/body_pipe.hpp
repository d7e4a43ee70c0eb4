#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"
#include "core/base/locked.hpp"

namespace anchord::server {

/// Bounded pipe from the io thread (feed, never blocks) to a handler on the pool (read, blocks).
class BodyPipe final : public api::BodyReader {
 public:
  explicit BodyPipe(std::size_t capacity) : capacity_(capacity) {}

  /// Handler side. Throws api::BodyError once fail() was called.
  std::size_t read(std::span<char> buffer) override;
  /// Handler side: reads no more. feed() becomes a no-op.
  void abandon();

  /// io side. Call feed only with at most space() bytes.
  void feed(std::string_view bytes);
  std::size_t space() const;
  std::size_t size() const;
  bool abandoned() const;
  void finish();
  void fail(int status, std::string why);
  /// Called from the handler's thread when space appears after none was left: only then does the io thread
  /// wait for it, and each call wakes it.
  void on_space(std::function<void()> call);

 private:
  struct Content {
    std::string bytes;
    std::size_t at{0};  ///< read so far
    bool ended{false}, abandoned{false};
    int failed_status{0};  ///< 0: not failed
    std::string failed;
    std::function<void()> on_space;
    std::size_t held() const { return bytes.size() - at; }
  };

  const std::size_t capacity_;
  Locked<Content> content_;
  std::condition_variable filled_;
};

}  // namespace anchord::server
