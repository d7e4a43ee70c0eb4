#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>

#include "api/application.hpp"
#include "core/base/guard.hpp"
#include "core/ports/backups.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/executor.hpp"

namespace anchord::test {

/// A server to which no device was ever given.
class NoDevices : public DeviceControl {
 public:
  std::vector<DeviceReport> devices() override { return {}; }
  Result<DeviceReport> device(const Uuid&) override { return none(); }
  Result<DeviceReport> add(DeviceConfig) override { return none(); }
  Result<DeviceReport> change(DeviceConfig, std::uint64_t) override { return none(); }
  Result<void> remove(const Uuid&, std::uint64_t) override { return none(); }
  Result<std::string> act(const Uuid&, std::string_view, std::string_view) override { return none(); }
  std::vector<DiscoveredDevice> discover() override { return {}; }
  std::vector<DiscoveredDevice> discovered() override { return {}; }
  DeviceClock clock() override { return {}; }
  void record_into(const std::optional<MissionId>&) override {}
  std::optional<MissionId> recording_into() override { return std::nullopt; }
  std::string recorder_failure() override { return {}; }

 protected:
  static Error none() { return make_error(Errc::not_found, "no device"); }
};

struct NoBackups final : Backups {
  Result<Backup> make(const std::function<bool()>&) override {
    return make_error(Errc::storage_unavailable, "none here");
  }
  std::vector<Backup> list() const override { return {}; }
  BackupState state() const override { return {}; }
  bool due(std::uint64_t) override { return false; }
};

/// Keeps what is posted until the test runs it; runs it at once, as InlineExecutor, while it is not holding.
class HeldExecutor final : public Executor {
 public:
  void post(Task task) override {
    if (!holding) return task();
    const std::scoped_lock lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  std::unique_ptr<Executor> strand() override { return std::make_unique<Strand>(*this); }
  std::size_t held() const {
    const std::scoped_lock lock(mutex_);
    return tasks_.size();
  }
  /// The oldest, and what it posts is held again; false: there is none.
  bool run_one() {
    Task task;
    {
      const std::scoped_lock lock(mutex_);
      if (tasks_.empty()) return false;
      task = std::move(tasks_.front());
      tasks_.pop_front();
    }
    task();
    return true;
  }
  std::atomic<bool> holding{true};

 private:
  struct Strand final : Executor {
    explicit Strand(HeldExecutor& of) : all(of) {}
    void post(Task task) override { all.post(std::move(task)); }
    std::unique_ptr<Executor> strand() override { return all.strand(); }
    HeldExecutor& all;
  };
  mutable std::mutex mutex_;
  std::deque<Task> tasks_;
};

/// The application with what the sockets' thread does for it: a round of the streams every 50 ms.
class StreamingApplication final : public api::Application {
 public:
  explicit StreamingApplication(Deps deps)
      : Application(std::move(deps)), rounds_("test-streams", [this] { run(); }) {}
  ~StreamingApplication() {
    {
      const std::scoped_lock lock(mutex_);
      ending_ = true;
    }
    told_.notify_all();
    rounds_.join();
  }

 private:
  void run() {
    std::unique_lock lock(mutex_);
    while (!told_.wait_for(lock, std::chrono::milliseconds(50), [this] { return ending_; })) stream_round();
  }
  std::mutex mutex_;
  std::condition_variable told_;
  bool ending_{false};
  Thread rounds_;
};

}  // namespace anchord::test
