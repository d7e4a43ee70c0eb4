#pragma once

#include <condition_variable>
#include <mutex>
#include <shared_mutex>
#include <stdexcept>
#include <utility>

namespace anchord {

/// A value and its mutex: the value is reached only through a guard that holds the mutex.
///
///   Locked<Queue> queue_;
///   auto queue = queue_.lock();
///   queue->rows.push_back(row);
///
/// A guard has a name and a short life: no disk, callback or second Locked while it lives. Where one Locked
/// is taken inside another, the class that does so states the order. Mutexes that guard no value but
/// serialise an action (one backup at a time) stay plain, and are taken before any Locked.
/// tests/layering_test.cmake lists them.
///
/// Mutex  std::mutex, or std::shared_mutex where many read (lock_shared())
template <class T, class Mutex = std::mutex>
class Locked {
 public:
  /// Use while it is not locked (a try_lock() that failed, inside unlocked()) is a std::logic_error.
  template <class Value, class Lock>
  class [[nodiscard]] Guard {
   public:
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;
    ~Guard() = default;

    explicit operator bool() const { return lock_.owns_lock(); }
    Value* operator->() const& { return &value(); }
    Value& operator*() const& { return value(); }
    // A guard without a name ends with its expression: what it gave would be used without the lock.
    Value* operator->() const&& = delete;
    Value& operator*() const&& = delete;

    /// Until holds(value); the mutex is free meanwhile.
    template <class Predicate>
    void wait(std::condition_variable& changed, Predicate holds) {
      changed.wait(lock_, [&] { return holds(std::as_const(value())); });
    }
    /// The same, at most so long: what holds(value) is then.
    template <class Duration, class Predicate>
    bool wait_for(std::condition_variable& changed, const Duration& most, Predicate holds) {
      return changed.wait_for(lock_, most, [&] { return holds(std::as_const(value())); });
    }
    template <class TimePoint, class Predicate>
    bool wait_until(std::condition_variable& changed, const TimePoint& end, Predicate holds) {
      return changed.wait_until(lock_, end, [&] { return holds(std::as_const(value())); });
    }

    /// Runs the work with the mutex free and takes it again, also when the work throws.
    template <class Work>
    decltype(auto) unlocked(Work&& work) {
      struct Again {
        Lock& lock;
        ~Again() { lock.lock(); }
      };
      lock_.unlock();
      const Again again{lock_};
      return std::forward<Work>(work)();
    }

   private:
    friend Locked;
    Guard(Value& value, Lock lock) : value_(value), lock_(std::move(lock)) {}
    Value& value() const {
      if (!lock_.owns_lock()) throw std::logic_error("the value of a Locked is used without its lock");
      return value_;
    }

    Value& value_;
    Lock lock_;
  };
  using Exclusive = Guard<T, std::unique_lock<Mutex>>;
  using Reader = Guard<const T, std::unique_lock<Mutex>>;
  using SharedReader = Guard<const T, std::shared_lock<Mutex>>;

  Locked() = default;
  /// The value from what its constructor takes.
  template <class... Args>
  explicit Locked(std::in_place_t, Args&&... args) : value_(std::forward<Args>(args)...) {}
  explicit Locked(T value) : value_(std::move(value)) {}
  Locked(const Locked&) = delete;
  Locked& operator=(const Locked&) = delete;
  ~Locked() = default;

  Exclusive lock() { return {value_, std::unique_lock(mutex_)}; }
  Reader lock() const { return {value_, std::unique_lock(mutex_)}; }
  /// False when somebody else has it.
  Exclusive try_lock() { return {value_, std::unique_lock(mutex_, std::try_to_lock)}; }
  /// Beside other readers (std::shared_mutex).
  SharedReader lock_shared() const { return {value_, std::shared_lock(mutex_)}; }

  T copy() const {
    const std::unique_lock held(mutex_);
    return value_;
  }
  /// The value before; whoever lets it go does so without the lock.
  T exchange(T next) {
    const std::unique_lock held(mutex_);
    std::swap(value_, next);
    return next;
  }

 private:
  mutable Mutex mutex_;
  T value_{};
};

}  // namespace anchord
