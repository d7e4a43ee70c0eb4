#include "drivers/device/device_loop.hpp"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <deque>
#include <random>

#include "core/base/guard.hpp"
#include "drivers/device/pipeline.hpp"
#include "drivers/device/rate.hpp"
#include "drivers/device/settings.hpp"
#include "drivers/link/serial_port.hpp"
#include "drivers/record/recorder.hpp"

namespace anchord::device {
namespace {

namespace asio = boost::asio;
using record::EventKind;

asio::steady_timer::time_point time_point(std::int64_t steady_ns) {
  return asio::steady_timer::time_point(std::chrono::nanoseconds(steady_ns));
}

/// For a device whose bytes make no frame, or whose messages give no row.
std::string unreadable(const Settings& settings, const link::Address& address,
                       const std::map<std::string, std::uint64_t>& dropped) {
  if (settings.kind == "ntrip")
    return "bytes are received, but they make no frame of RTCM 3, and nothing else goes to receivers: choose "
           "a "
           "mount of RTCM 3";
  const bool mapped = settings.kind == "mqtt" || settings.kind == "ndjson";
  if (mapped && !dropped.empty()) {
    const auto most =
        std::ranges::max_element(dropped, {}, &std::map<std::string, std::uint64_t>::value_type::second);
    return "messages are received, but none of them can be used, most of them for " + most->first +
           ": correct the mapping, or what the device sends";
  }
  std::string out = "bytes are received, but they make no frame: is it a " + settings.kind + " device";
  if (settings.kind == "gnss") out += " that sends the format that is set (auto accepts any)";
  if (address.kind == link::Kind::serial)
    out += ", and is its baud rate " + std::to_string(address.baud) + " baud";
  return out + "?";
}

/// A device is one entry; the slot is its number in the recording.
struct Entry {
  Entry(asio::io_context& io, Settings s, link::Address a)
      : settings(std::move(s)), address(std::move(a)), timer(io) {}
  Settings settings;
  link::Address address;
  asio::steady_timer timer;
  std::unique_ptr<link::ByteLink> link;
  Supervision supervision;
  bool listens{false}, present{true}, fed{false};
  std::optional<std::int64_t> armed_ns{};
  std::uint64_t generation{0};  ///< of the link, so that a late report of an old one is known
  std::uint64_t device_number{0};
  std::uint64_t bytes_understood{0};  ///< of this link, up to its last good frame
  DeviceState told;                   ///< counters, identity, rover
  Rate rate;
  std::int64_t hang_up_wait_ns{0};
  std::string hang_up;
  std::string notice;  ///< of this link's driver
  Noise noise{};
  SentIds ids{};
};

}  // namespace

class DeviceLoop::Impl final : public PipelineSink, public std::enable_shared_from_this<DeviceLoop::Impl> {
 public:
  Impl(asio::io_context& io, record::Recorder* recorder, DeviceListener& listener, const LoopOptions& options)
      : io_(io),
        recorder_(recorder),
        listener_(listener),
        options_(options),
        poll_(io),
        random_(options.seed),
        pipeline_(*this) {}

  void start() { poll(); }
  void stop() {
    stopped_ = true;
    poll_.cancel();
    for (auto& [slot, entry] : entries_) {
      entry.timer.cancel();
      drop_link(slot);
    }
  }

  // --- the operator's side ---------------------------------------------------------------------------------
  Result<void> add(const Settings& settings) {
    BOOST_OUTCOME_TRY(const auto address, link::parse_address(settings.address));
    for (const auto& [slot, entry] : entries_) {
      if (entry.settings.id == settings.id)
        return make_error(Errc::conflict, "a device with this id already exists");
      // One caster has many mount points, one broker many topics.
      const bool shared = settings.kind == "ntrip" || settings.kind == "mqtt";
      if (shared && settings.kind == entry.settings.kind) continue;
      if (entry.address == address && (address.kind == link::Kind::serial || address.port != 0)) {
        return make_error(Errc::conflict, "address: " + settings.address + " is used by device \"" +
                                              entry.settings.name + "\"");
      }
    }
    const auto slot = next_slot_;
    const auto json = to_json(settings);
    BOOST_OUTCOME_TRY(take({EventKind::added, slot, link::arrival_now(), json}));
    ++next_slot_;
    auto& entry = entries_.try_emplace(slot, io_, settings, address).first->second;
    entry.listens = address.kind == link::Kind::tcp_listen;
    entry.supervision.since_ns = now();
    happen(slot, {Happened::appeared, now()});
    return boost::outcome_v2::success();
  }

  Result<void> remove(const std::string& id) {
    const auto slot = slot_of(id);
    if (!slot) return make_error(Errc::not_found, "there is no such device");
    // First: what its driver still held, such as the epoch of now, comes out while somebody hears it.
    (void)take({EventKind::removed, *slot, link::arrival_now(), {}});
    entries_.erase(*slot);
    if (based_on_ == id && pipeline_.mission() == MissionId{}) base_watch_ = {};
    listener_.changed(id);
    return boost::outcome_v2::success();
  }

  Result<void> command(const std::string& id, const Command& command) {
    const auto slot = slot_of(id);
    if (!slot) return make_error(Errc::not_found, "there is no such device");
    const auto& entry = entries_.at(*slot);
    if (entry.supervision.phase == Phase::lost || entry.supervision.phase == Phase::found) {
      return make_error(Errc::link_lost, "the device is not connected: " + entry.supervision.reason);
    }
    const auto json = to_json(command);
    feed({EventKind::command, *slot, link::arrival_now(), json});
    return boost::outcome_v2::success();
  }

  void record_into(const std::optional<MissionId>& mission) {
    const auto text = mission ? to_string(*mission) : std::string();
    (void)take({EventKind::mission, 0, link::arrival_now(), text});
    base_watch_.flight(mission.has_value());
  }

  void record_to(record::Recorder* recorder) {
    recorder_ = recorder;
    if (recorder_ == nullptr) return;
    const auto at = link::arrival_now();
    for (const auto& [slot, entry] : entries_) {
      const auto json = to_json(entry.settings);
      recorder_->take({EventKind::added, slot, at, json});
    }
    if (pipeline_.mission() == MissionId{}) return;
    const auto mission = to_string(pipeline_.mission());
    recorder_->take({EventKind::mission, 0, at, mission});
  }

  std::vector<DeviceState> devices() const {
    std::vector<DeviceState> out;
    for (const auto& [slot, entry] : entries_) out.push_back(state_of(entry));
    return out;
  }
  std::optional<DeviceState> device(const std::string& id) const {
    const auto slot = slot_of(id);
    return slot ? std::optional(state_of(entries_.at(*slot))) : std::nullopt;
  }
  ClockState clock() const {
    const auto& time = const_cast<Pipeline&>(pipeline_).time();
    ClockState out;
    out.from_receiver = time.source() == timing::TimeSource::receiver;
    out.system_offset_s = time.system_offset_s();
    out.sigma_s = time.utc_of(now()).sigma_s;
    out.skew = time.skew([&](int slot) {
                     const auto found = entries_.find(static_cast<std::uint16_t>(slot));
                     return found == entries_.end() ? std::string("?") : found->second.settings.name;
                   })
                   .value_or("");
    for (const auto& [slot, entry] : entries_) {
      // No running numbers: this becomes an alarm, and a new text would ask for attention anew.
      if (out.skew.empty() && entry.told.clock && entry.told.clock->skewed)
        out.skew = "the clock of device \"" + entry.settings.name +
                   "\" drifts by more than 200 ppm: its stamps cannot be trusted";
    }
    return out;
  }
  std::uint16_t port(const std::string& id) const {
    const auto slot = slot_of(id);
    const auto* link = slot ? entries_.at(*slot).link.get() : nullptr;
    return link != nullptr ? link->port() : std::uint16_t{0};
  }

  // --- what the pipeline says ------------------------------------------------------------------------------
  void send(std::uint16_t slot, std::string_view bytes) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end() || !found->second.link) return;
    if (const auto done = found->second.link->write(bytes); !done) {
      count(slot, done.error().code == Errc::queue_full ? "write_refused" : "write_without_link", 1);
    }
  }
  void fix(std::uint16_t slot, const Fix& fix) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end()) return;
    ++found->second.told.fixes;
    found->second.rate.count(now());
    if (fix.mission == MissionId{}) return;
    listener_.fix(found->second.settings.id, fix);
  }
  void range(std::uint16_t slot, const Range& range) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end()) return;
    ++found->second.told.ranges;
    found->second.ids.note(range);
    found->second.rate.count(now());
    if (range.mission == MissionId{}) return;
    listener_.range(found->second.settings.id, range);
  }
  void rover(std::uint16_t slot, const RoverStatus& status) override {
    if (const auto found = entries_.find(slot); found != entries_.end()) found->second.told.rover = status;
  }
  void identified(std::uint16_t slot, const Identity& identity) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end() || found->second.told.identity == identity) return;
    found->second.told.identity = identity;
    find_conflicts();
    listener_.changed(found->second.settings.id);
  }
  void clock(std::uint16_t slot, const ClockReading& reading) override {
    if (const auto found = entries_.find(slot); found != entries_.end()) found->second.told.clock = reading;
  }
  void base(std::uint16_t slot, const BaseStation& station) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end()) return;
    found->second.told.base = station;
    if (!pipeline_.may_correct(slot)) return;
    based_on_ = found->second.settings.id;
    base_watch_.note(station);
  }
  void heard(std::uint16_t slot) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end()) return;
    ++found->second.told.frames;
    found->second.noise.heard();
    found->second.told.last_seen = now_.utc;
    if (const auto& link = found->second.link) found->second.bytes_understood = link->counters().bytes_in;
    happen(slot, {Happened::heard, now()});
  }
  void dropped(std::uint16_t slot, std::string_view reason, std::uint64_t n) override {
    count(slot, reason, n);
  }
  void notice(std::uint16_t slot, std::string_view text) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end() || found->second.notice == text) return;
    found->second.notice = text;
    listener_.changed(found->second.settings.id);
  }
  void unused(std::uint16_t slot, std::string_view why) override {
    const auto found = entries_.find(slot);
    if (found == entries_.end() || found->second.told.unused == why) return;
    found->second.told.unused = why;
    listener_.changed(found->second.settings.id);
  }
  void answer(std::uint16_t slot, std::uint64_t id, const Result<std::string>& json) override {
    if (const auto found = entries_.find(slot); found != entries_.end()) {
      listener_.answer(found->second.settings.id, id, json);
    }
  }
  void hang_up(std::uint16_t slot, std::string_view why, std::int64_t wait_ns) override {
    // Not from inside the driver's own call: feed() does it afterwards.
    if (const auto found = entries_.find(slot); found != entries_.end()) {
      found->second.hang_up = why;
      found->second.hang_up_wait_ns = wait_ns;
    }
  }

 private:
  std::int64_t now() const { return link::arrival_now().steady_ns; }
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  std::optional<std::uint16_t> slot_of(const std::string& id) const {
    for (const auto& [slot, entry] : entries_) {
      if (entry.settings.id == id) return slot;
    }
    return std::nullopt;
  }

  /// The name under which a fault of this device is told.
  std::string task_of(std::uint16_t slot) const {
    const auto found = entries_.find(slot);
    return found == entries_.end() ? "driver" : "driver of device \"" + found->second.settings.name + '"';
  }

  DeviceState state_of(const Entry& entry) const {
    auto out = entry.told;
    out.settings = entry.settings;
    out.phase = entry.supervision.phase;
    out.reason = entry.supervision.reason;
    out.too_many_ids = entry.ids.trouble();
    if (entry.settings.id == based_on_) out.moved_base = base_watch_.trouble();
    if (out.phase == Phase::talking && out.reason.empty())
      out.reason = !out.unused.empty()       ? out.unused
                   : !entry.notice.empty()   ? entry.notice
                   : !out.moved_base.empty() ? out.moved_base
                                             : out.too_many_ids;
    const auto at = now();
    out.in_phase_s = static_cast<double>(at - entry.supervision.since_ns) * 1e-9;
    out.rows_per_s = entry.rate.value(at);
    if (entry.link) {
      out.bytes_in += entry.link->counters().bytes_in;
      out.bytes_out += entry.link->counters().bytes_out;
      if (out.phase == Phase::silent && entry.link->counters().bytes_in > entry.bytes_understood)
        out.reason = unreadable(entry.settings, entry.address, out.dropped) +
                     (entry.noise.skipped() ? " Only a sample of them is recorded." : "");
    }
    return out;
  }

  void count(std::uint16_t slot, std::string_view reason, std::uint64_t n) {
    const auto found = entries_.find(slot);
    if (found == entries_.end()) return;
    auto& dropped = found->second.told.dropped;
    // Reasons come from the drivers' fixed sets; the bound is for a driver that forgets that.
    if (dropped.size() >= 64 && dropped.count(std::string(reason)) == 0) reason = "other";
    dropped[std::string(reason)] += n;
  }

  Result<void> take(const record::Event& event) {
    now_ = event.at;
    if (recorder_ == nullptr) return pipeline_.take(event);
    const auto found = entries_.find(event.slot);
    const bool bytes = event.kind == EventKind::bytes && found != entries_.end();
    const bool flight = pipeline_.mission() != MissionId{};
    if (!bytes || found->second.noise.is_worth_recording(event.payload.size(), event.at.steady_ns, flight,
                                                         options_.noise)) {
      if (bytes) found->second.told.recorded += event.payload.size();
      recorder_->take(event);
      return pipeline_.take(event);
    }
    // Noise so far: recorded only when a frame ends in it.
    auto& told = found->second.told;
    const auto before = told.frames;
    auto done = pipeline_.take(event);
    if (told.frames == before) {
      count(event.slot, "noise_not_recorded_bytes", event.payload.size());
      return done;
    }
    told.recorded += event.payload.size();
    recorder_->take(event);
    return done;
  }

  /// The third door of exceptions: what a driver throws ends its link, not the flight.
  void feed(const record::Event& event) {
    const auto slot = event.slot;
    const auto ran = guarded(task_of(slot), [&] {
      if (const auto done = take(event); !done) count(slot, "refused_event", 1);
    });
    const auto found = entries_.find(slot);
    if (found == entries_.end()) return;
    if (!ran) {
      count(slot, "driver_fault", 1);
      found->second.hang_up = "fault in the driver: " + ran.what;
    }
    if (!found->second.hang_up.empty()) {
      const auto why = std::exchange(found->second.hang_up, {});
      end_link(slot, why, std::exchange(found->second.hang_up_wait_ns, 0));
      return;
    }
    arm(slot);
  }

  /// The link is gone or given up: the driver hears of it once, then the supervisor.
  void end_link(std::uint16_t slot, const std::string& why, std::int64_t not_before_ns = 0) {
    drop_link(slot);
    happen(slot, {Happened::closed, now(), uniform(), why, not_before_ns});
  }

  void drop_link(std::uint16_t slot) {
    auto& entry = entries_.at(slot);
    ++entry.generation;
    if (entry.link) {
      entry.told.bytes_in += entry.link->counters().bytes_in;
      entry.told.bytes_out += entry.link->counters().bytes_out;
      entry.link.reset();
    }
    entry.device_number = 0;
    entry.told.clock.reset();
    entry.told.base.reset();
    entry.notice.clear();
    if (std::exchange(entry.fed, false)) {
      ++entry.told.lost;
      const auto ran = guarded(task_of(slot), [&] {
        (void)take({EventKind::closed, slot, link::arrival_now(), {}});
      });
      if (!ran) count(slot, "driver_fault", 1);
    }
  }

  void happen(std::uint16_t slot, const Occurrence& occurrence) {
    const auto found = entries_.find(slot);
    if (found == entries_.end()) return;
    auto& entry = found->second;
    const auto before = entry.supervision.phase;
    const auto old_reason = entry.supervision.reason;
    const auto step = advance(entry.supervision, occurrence, supervisor_of(entry));
    entry.supervision = step.next;
    if (step.wanted == Wanted::close) drop_link(slot);
    if (step.wanted == Wanted::open) open(slot);
    if (entry.supervision.phase != before ||
        (before == Phase::lost && entry.supervision.reason != old_reason)) {
      listener_.changed(entry.settings.id);
    }
    arm(slot);
  }

  /// A caster or a peer that comes to us need not speak for a while.
  SupervisorOptions supervisor_of(const Entry& entry) const {
    auto out = options_.supervisor;
    if (entry.settings.kind == "ntrip") {
      out.first_wait_ns = 1'000'000'000;
      out.longest_wait_ns = 30'000'000'000;
      out.silent_after_ns = 10'000'000'000;
      out.reopen_after_ns = 30'000'000'000;
    }
    // Closing a listening socket drops nobody but the peer that may yet speak.
    if (entry.listens) out.reopen_after_ns = 3600 * std::int64_t{1'000'000'000};
    return out;
  }

  void open(std::uint16_t slot) {
    auto& entry = entries_.at(slot);
    if (entry.address.kind == link::Kind::serial) {
      const auto number = link::device_number(entry.address.path);
      entry.present = static_cast<bool>(number);
      entry.device_number = number ? number.value() : 0;
      for (const auto& [other_slot, other] : entries_) {
        if (other_slot == slot || !number || other.device_number != number.value()) continue;
        entry.device_number = 0;
        entry.told.conflict =
            "the same port as device \"" + other.settings.name + "\" (" + other.settings.id + ")";
        count(slot, "port_conflict", 1);
        happen(slot, {Happened::closed, now(), uniform(), entry.address.path + ": " + entry.told.conflict});
        return;
      }
    }
    entry.link = link::make_link(io_, entry.address);
    entry.bytes_understood = 0;
    const auto generation = ++entry.generation;
    const auto current = [weak = weak_from_this(), slot, generation]() -> std::shared_ptr<Impl> {
      auto self = weak.lock();
      if (!self || self->stopped_) return nullptr;
      const auto found = self->entries_.find(slot);
      return found != self->entries_.end() && found->second.generation == generation ? self : nullptr;
    };
    entry.link->open({[current, slot] {
                        if (const auto self = current()) self->opened(slot);
                      },
                      [current, slot](std::string_view bytes, const link::Arrival& at) {
                        if (const auto self = current()) self->feed({EventKind::bytes, slot, at, bytes});
                      },
                      [current, slot](const Error& why) {
                        if (const auto self = current()) self->end_link(slot, why.message);
                      }});
  }

  void opened(std::uint16_t slot) {
    auto& entry = entries_.at(slot);
    ++entry.told.opened;
    entry.fed = true;
    entry.told.conflict.clear();
    find_conflicts();
    happen(slot, {Happened::opened, now()});
    feed({EventKind::opened, slot, link::arrival_now(), {}});
  }

  /// One timer for the supervisor's and the driver's wishes.
  void arm(std::uint16_t slot) {
    auto& entry = entries_.at(slot);
    auto due = deadline_ns(entry.supervision, supervisor_of(entry));
    // A port that is not plugged in is not tried; the poll sees it come.
    if (entry.supervision.phase == Phase::lost && !entry.present) due.reset();
    if (const auto wish = pipeline_.deadline_ns(slot); wish && (!due || *wish < *due)) due = wish;
    if (!due) {
      entry.timer.cancel();
      entry.armed_ns.reset();
      return;
    }
    if (entry.armed_ns == *due) return;
    entry.armed_ns = *due;
    entry.timer.expires_at(time_point(*due));
    entry.timer.async_wait([weak = weak_from_this(), slot](const boost::system::error_code& error) {
      const auto self = weak.lock();
      if (error || !self || self->stopped_) return;
      const auto found = self->entries_.find(slot);
      if (found == self->entries_.end()) return;
      found->second.armed_ns.reset();
      // Armed again in any case: a device whose timer is gone is never tried again.
      if (!guarded(self->task_of(slot), [&] { self->rang(slot); })) self->arm(slot);
    });
  }

  void rang(std::uint16_t slot) {
    const auto at = link::arrival_now();
    if (const auto wish = pipeline_.deadline_ns(slot); wish && *wish <= at.steady_ns) {
      feed({EventKind::tick, slot, at, {}});
    }
    happen(slot, {Happened::tick, at.steady_ns, uniform()});
  }

  void poll() {
    poll_.expires_after(std::chrono::milliseconds(options_.presence_poll_ms));
    poll_.async_wait([weak = weak_from_this()](const boost::system::error_code& error) {
      const auto self = weak.lock();
      if (error || !self || self->stopped_) return;
      (void)guarded("serial ports", [&] { self->look(); });
      self->poll();
    });
  }

  void look() {
    std::vector<std::uint16_t> came;
    for (auto& [slot, entry] : entries_) {
      if (entry.address.kind != link::Kind::serial || entry.supervision.phase != Phase::lost) continue;
      const bool there = static_cast<bool>(link::device_number(entry.address.path));
      if (there && !entry.present) came.push_back(slot);
      entry.present = there;
    }
    for (const auto slot : came) happen(slot, {Happened::appeared, now(), uniform()});
  }

  void find_conflicts() {
    for (auto& [slot, entry] : entries_) {
      if (!entry.told.identity.network_id) continue;
      entry.told.conflict.clear();
      for (const auto& [other_slot, other] : entries_) {
        if (other_slot == slot || other.told.identity.network_id != entry.told.identity.network_id) continue;
        entry.told.conflict = to_string(*entry.told.identity.network_id) + " is also device \"" +
                              other.settings.name + "\" (" + other.settings.id + ")";
      }
    }
  }

  asio::io_context& io_;
  // Of the flight and not of a device: one that is changed or added meanwhile starts nothing anew.
  BaseWatch base_watch_{};
  std::string based_on_;  ///< id of the device whose corrections it watches
  record::Recorder* recorder_;
  DeviceListener& listener_;
  LoopOptions options_;
  asio::steady_timer poll_;
  std::mt19937_64 random_;
  Pipeline pipeline_;
  std::map<std::uint16_t, Entry> entries_;
  link::Arrival now_{};
  std::uint16_t next_slot_{1};
  bool stopped_{false};
};

DeviceLoop::DeviceLoop(asio::io_context& io, record::Recorder* recorder, DeviceListener& listener,
                       const LoopOptions& options)
    : impl_(std::make_shared<Impl>(io, recorder, listener, options)) {
  impl_->start();
}
DeviceLoop::~DeviceLoop() { impl_->stop(); }

Result<void> DeviceLoop::add(const Settings& settings) { return impl_->add(settings); }
Result<void> DeviceLoop::remove(const std::string& id) { return impl_->remove(id); }
Result<void> DeviceLoop::command(const std::string& id, const Command& command) {
  return impl_->command(id, command);
}
void DeviceLoop::record_into(const std::optional<MissionId>& mission) { impl_->record_into(mission); }
void DeviceLoop::record_to(record::Recorder* recorder) { impl_->record_to(recorder); }
std::vector<DeviceState> DeviceLoop::devices() const { return impl_->devices(); }
std::optional<DeviceState> DeviceLoop::device(const std::string& id) const { return impl_->device(id); }
ClockState DeviceLoop::clock() const { return impl_->clock(); }
std::uint16_t DeviceLoop::port(const std::string& id) const { return impl_->port(id); }

}  // namespace anchord::device
