#include "server/http/body_pipe.hpp"

#include <algorithm>
#include <utility>

namespace anchord::server {

std::size_t BodyPipe::read(std::span<char> buffer) {
  std::size_t n = 0;
  std::function<void()> call;
  {
    std::unique_lock lock(mutex_);
    filled_.wait(lock, [this] { return at_ < bytes_.size() || ended_ || failed_status_ != 0; });
    if (at_ == bytes_.size()) {
      if (failed_status_ != 0) {
        throw api::BodyError(failed_status_, failed_);
      }
      return 0;
    }
    n = std::min(buffer.size(), bytes_.size() - at_);
    std::copy_n(bytes_.data() + at_, n, buffer.data());
    at_ += n;
    if (at_ == bytes_.size()) {
      bytes_.clear();
      at_ = 0;
    } else if (at_ > capacity_ / 2) {
      bytes_.erase(0, at_);
      at_ = 0;
    }
    call = on_space_;
  }
  if (call) call();
  return n;
}

void BodyPipe::abandon() {
  std::function<void()> call;
  {
    const std::lock_guard lock(mutex_);
    abandoned_ = true;
    bytes_.clear();
    at_ = 0;
    call = on_space_;
  }
  if (call) call();
}

void BodyPipe::feed(std::string_view bytes) {
  {
    const std::lock_guard lock(mutex_);
    if (abandoned_) return;
    bytes_.append(bytes);
  }
  filled_.notify_one();
}

std::size_t BodyPipe::space() const {
  const std::lock_guard lock(mutex_);
  const std::size_t held = bytes_.size() - at_;
  return held >= capacity_ ? 0 : capacity_ - held;
}

std::size_t BodyPipe::size() const {
  const std::lock_guard lock(mutex_);
  return bytes_.size() - at_;
}

bool BodyPipe::abandoned() const {
  const std::lock_guard lock(mutex_);
  return abandoned_;
}

void BodyPipe::finish() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  filled_.notify_one();
}

void BodyPipe::fail(int status, std::string why) {
  {
    const std::lock_guard lock(mutex_);
    failed_status_ = status;
    failed_ = std::move(why);
  }
  filled_.notify_one();
}

void BodyPipe::on_space(std::function<void()> call) {
  const std::lock_guard lock(mutex_);
  on_space_ = std::move(call);
}

}  // namespace anchord::server
