#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "drivers/port/driver.hpp"
#include "drivers/port/one_source.hpp"
#include "drivers/record/event.hpp"
#include "drivers/time/time_base.hpp"

namespace anchord::device {

/// Where the pipeline's results go, with the slot of the device they are of.
class PipelineSink {
 public:
  virtual ~PipelineSink() = default;
  virtual void send(std::uint16_t slot, std::string_view bytes) = 0;
  /// Rows carry the mission that records; a zero mission when none does.
  virtual void fix(std::uint16_t slot, const Fix& fix) = 0;
  virtual void range(std::uint16_t slot, const Range& range) = 0;
  virtual void rover(std::uint16_t slot, const RoverStatus& status) = 0;
  virtual void identified(std::uint16_t slot, const Identity& identity) = 0;
  virtual void clock(std::uint16_t slot, const ClockReading& reading) { (void)slot, (void)reading; }
  virtual void base(std::uint16_t slot, const BaseStation& station) { (void)slot, (void)station; }
  virtual void heard(std::uint16_t slot) = 0;
  virtual void dropped(std::uint16_t slot, std::string_view reason, std::uint64_t n) = 0;
  virtual void notice(std::uint16_t slot, std::string_view text) { (void)slot, (void)text; }
  virtual void unused(std::uint16_t slot, std::string_view why) { (void)slot, (void)why; }
  virtual void answer(std::uint16_t slot, std::uint64_t command_id, const Result<std::string>& json) = 0;
  virtual void hang_up(std::uint16_t slot, std::string_view why, std::int64_t wait_ns) = 0;
};

/// All drivers of one server (or of one recording) behind one entrance. Every input is an event, and nothing
/// else is: live, the events come from links and timers and are recorded first; in a replay they come from
/// the file. Rows are the same, byte for byte. Pure; not thread-safe.
class Pipeline {
 public:
  explicit Pipeline(PipelineSink& sink);
  ~Pipeline();
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// errors: of `added` (invalid_argument: settings no driver takes) and of events that cannot be read
  /// (bad_frame); an event for a slot that is not there is not_found. All of them leave the rest as it was.
  Result<void> take(const record::Event& event);
  /// When the slot's driver wants its tick, steady ns.
  std::optional<std::int64_t> deadline_ns(std::uint16_t slot) const;
  timing::TimeBase& time() { return time_; }
  const MissionId& mission() const { return mission_; }
  /// Its corrections are those that go to the rovers, or nobody's do yet.
  bool may_correct(std::uint16_t slot) const { return corrections_.may_be(slot); }

 private:
  class Device;
  Result<void> add(std::uint16_t slot, std::string_view json);
  void correct(std::string_view bytes);
  bool records() const { return mission_ != MissionId{}; }

  PipelineSink& sink_;
  timing::TimeBase time_;
  MissionId mission_{};
  std::map<std::uint16_t, std::unique_ptr<Device>> devices_;
  std::optional<RoverStatus> rover_{};  ///< of the receiver that gives the track
  OneSource<std::uint16_t> track_{}, corrections_{};
  std::int64_t now_ns_{0};  ///< steady, of the event that is taken
};

}  // namespace anchord::device
