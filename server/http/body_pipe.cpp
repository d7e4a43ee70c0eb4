#include "server/http/body_pipe.hpp"

#include <algorithm>
#include <utility>

namespace anchord::server {

std::size_t BodyPipe::read(std::span<char> buffer) {
  std::size_t n = 0;
  std::function<void()> call;
  {
    auto content = content_.lock();
    content.wait(filled_, [](const Content& c) { return c.held() > 0 || c.ended || c.failed_status != 0; });
    if (content->held() == 0) {
      if (content->failed_status != 0) throw api::BodyError(content->failed_status, content->failed);
      return 0;
    }
    if (content->held() >= capacity_) call = content->on_space;
    n = std::min(buffer.size(), content->held());
    std::copy_n(content->bytes.data() + content->at, n, buffer.data());
    content->at += n;
    if (content->held() == 0) {
      content->bytes.clear();
      content->at = 0;
    } else if (content->at > capacity_ / 2) {
      content->bytes.erase(0, content->at);
      content->at = 0;
    }
  }
  if (call) call();
  return n;
}

void BodyPipe::abandon() {
  std::function<void()> call;
  {
    auto content = content_.lock();
    if (content->held() >= capacity_) call = content->on_space;
    content->abandoned = true;
    content->bytes.clear();
    content->at = 0;
  }
  if (call) call();
}

void BodyPipe::feed(std::string_view bytes) {
  {
    auto content = content_.lock();
    if (content->abandoned) return;
    content->bytes.append(bytes);
  }
  filled_.notify_one();
}

std::size_t BodyPipe::space() const {
  const std::size_t held = size();
  return held >= capacity_ ? 0 : capacity_ - held;
}

std::size_t BodyPipe::size() const {
  const auto content = content_.lock();
  return content->held();
}

bool BodyPipe::abandoned() const {
  const auto content = content_.lock();
  return content->abandoned;
}

void BodyPipe::finish() {
  {
    auto content = content_.lock();
    content->ended = true;
  }
  filled_.notify_one();
}

void BodyPipe::fail(int status, std::string why) {
  {
    auto content = content_.lock();
    content->failed_status = status;
    content->failed = std::move(why);
  }
  filled_.notify_one();
}

void BodyPipe::on_space(std::function<void()> call) {
  auto content = content_.lock();
  content->on_space = std::move(call);
}

}  // namespace anchord::server
