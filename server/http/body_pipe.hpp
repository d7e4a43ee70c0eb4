#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"

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
  /// Called from the handler's thread when space appears after none was left, and at abandon().
  void on_space(std::function<void()> call);

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::string bytes_;
  std::size_t at_{0};
  bool ended_{false}, abandoned_{false};
  int failed_status_{0};  ///< 0: not failed
  std::string failed_;
  std::function<void()> on_space_;
};

}  // namespace anchord::server
