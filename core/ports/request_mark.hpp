#pragma once

#include <utility>

#include "core/ports/access_store.hpp"

namespace anchord {

/// While it lives, what this thread writes is for one request with an Idempotency-Key: the store keeps
/// `begun`, an answer of status 0, in the transaction of each write but those of the AccessStore itself.
/// Whoever is asked with the key again knows then that something of it was done, although the answer was
/// lost.
class RequestMark {
 public:
  explicit RequestMark(const StoredAnswer& begun) : before_(std::exchange(current_, &begun)) {}
  ~RequestMark() { current_ = before_; }
  RequestMark(const RequestMark&) = delete;
  RequestMark& operator=(const RequestMark&) = delete;
  /// nullptr: this thread writes for no such request.
  static const StoredAnswer* current() { return current_; }

 private:
  static inline thread_local const StoredAnswer* current_ = nullptr;
  const StoredAnswer* const before_;
};

}  // namespace anchord
