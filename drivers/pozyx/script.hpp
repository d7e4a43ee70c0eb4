#pragma once

#include <coroutine>
#include <exception>
#include <optional>
#include <utility>

namespace anchord::pozyx {

/// A conversation written as one goes through it: question, answer, next question. Runs only inside calls of
/// whoever feeds it bytes and time (Conversation), so it is a state machine whose states the compiler
/// numbers: no thread, no clock, the same bytes and times give the same run. Destroying it abandons the
/// conversation where it stands. Parameters of scripts are values; what is awaited has named arguments,
/// because g++ 12 destroys temporaries of conditional expressions twice there.
template <class T>
class [[nodiscard]] Script {
 public:
  struct promise_type {
    std::optional<T> value{};
    std::exception_ptr error{};
    std::coroutine_handle<> next{std::noop_coroutine()};

    Script get_return_object() { return Script(std::coroutine_handle<promise_type>::from_promise(*this)); }
    std::suspend_always initial_suspend() noexcept { return {}; }
    auto final_suspend() noexcept {
      struct Continue {
        bool await_ready() noexcept { return false; }
        std::coroutine_handle<> await_suspend(std::coroutine_handle<promise_type> done) noexcept {
          return done.promise().next;
        }
        void await_resume() noexcept {}
      };
      return Continue{};
    }
    void return_value(T result) { value.emplace(std::move(result)); }
    void unhandled_exception() { error = std::current_exception(); }
  };

  Script(Script&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Script& operator=(Script&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Script() {
    if (handle_) handle_.destroy();
  }

  /// Runs until it waits for the first time.
  void start() { handle_.resume(); }
  bool done() const { return handle_.done(); }
  void rethrow() const {
    if (handle_.promise().error) std::rethrow_exception(handle_.promise().error);
  }

  bool await_ready() const noexcept { return false; }
  std::coroutine_handle<> await_suspend(std::coroutine_handle<> caller) noexcept {
    handle_.promise().next = caller;
    return handle_;
  }
  T await_resume() {
    rethrow();
    return std::move(*handle_.promise().value);
  }

 private:
  explicit Script(std::coroutine_handle<promise_type> handle) : handle_(handle) {}
  std::coroutine_handle<promise_type> handle_;
};

}  // namespace anchord::pozyx
