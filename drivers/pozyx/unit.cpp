#include "drivers/pozyx/unit.hpp"

#include <algorithm>
#include <utility>

#include "drivers/pozyx/registers.hpp"
#include "drivers/time/time_base.hpp"

namespace anchord::pozyx {
namespace {

using device::Arrival;

constexpr std::int64_t k_s = 1'000'000'000;
constexpr std::size_t k_max_commands = 16;
constexpr int k_failures = 5;

}  // namespace

Unit::Unit(UnitOptions options, device::DriverOutput& output) : options_(std::move(options)), out_(output) {}

Unit::~Unit() = default;

void Unit::opened(const Arrival& now) {
  session_ = std::make_unique<Session>([this](std::string_view bytes) { out_.send(bytes); });
  session_->wire.set_now(now.steady_ns);
  unwrap_.emplace(32);
  anchors_.clear();
  for (const std::uint16_t id : options_.anchors) anchors_[id];
  look_at_ns_ = between_at_ns_ = 0;
  looks_ = 0;
  session_->script.emplace(run());
  session_->script->start();
  after();
}

void Unit::bytes(std::string_view bytes, const Arrival& at) {
  if (!session_) opened(at);
  session_->wire.bytes(bytes, at.steady_ns);
  after();
}

void Unit::tick(const Arrival& now) {
  if (!session_) return;
  session_->wire.tick(now.steady_ns);
  after();
}

std::optional<std::int64_t> Unit::deadline_ns() const {
  return session_ ? session_->wire.deadline_ns() : std::nullopt;
}

void Unit::closed(const Arrival&) {
  session_.reset();
  const auto gone = [this](std::uint64_t id) {
    out_.answer(id, make_error(Errc::link_lost, "the tag was unplugged"));
  };
  if (running_ && rebooting_) {
    out_.answer(*std::exchange(running_, std::nullopt), std::string("{}"));
  } else if (running_) {
    gone(*std::exchange(running_, std::nullopt));
  }
  rebooting_ = false;
  for (const device::Command& command : std::exchange(commands_, {})) gone(command.id);
}

void Unit::command(const device::Command& command, const Arrival& now) {
  if (!session_) return out_.answer(command.id, make_error(Errc::link_lost, "the tag is not connected"));
  if (commands_.size() >= k_max_commands)
    return out_.answer(
        command.id,
        make_error(Errc::queue_full, "16 commands are already waiting for the tag: wait for their answers"));
  commands_.push_back(command);
  session_->wire.set_now(now.steady_ns);
  after();
}

void Unit::after() {
  // What went wrong on the wire since the last report.
  const ConversationCounters& now = session_->wire.counters();
  ConversationCounters& reported = session_->reported;
  const auto report = [this](std::string_view reason, std::uint64_t now_n, std::uint64_t reported_n) {
    if (now_n > reported_n) out_.dropped(reason, now_n - reported_n);
  };
  report("no_reply", now.timeouts, reported.timeouts);
  report("bad_reply", now.bad_replies, reported.bad_replies);
  report("stray_line", now.stray_lines, reported.stray_lines);
  reported = now;
  if (session_->script && session_->script->done()) session_->script->rethrow();
}

UtcTime Unit::utc_of(std::int64_t steady_ns) { return out_.time().utc_of(steady_ns).time; }

Script<int> Unit::run() {
  const Result<void> there = co_await session_->wire.open();
  Result<void> ready = there;
  if (there) ready = co_await prepare();
  if (!ready) {
    const bool refused = ready.error().code == Errc::unsupported;
    out_.hang_up(ready.error().message, (refused ? 60 : 1) * k_s);
    co_return 0;
  }
  for (;;) {
    if (!commands_.empty()) {
      const device::Command command = commands_.front();
      commands_.pop_front();
      co_await execute(command);
    }
    if (options_.anchors.empty() && session_->wire.now_ns() >= look_at_ns_) co_await look_around();
    if (options_.anchor_anchor_s > 0 && session_->wire.now_ns() >= between_at_ns_) co_await range_anchors();
    co_await range_next();
  }
}

Script<Result<void>> Unit::prepare() {
  const Result<TagIdentity> identity = co_await session_->tag.identify();
  if (!identity) co_return identity.error();
  identity_ = identity.value();
  out_.heard();
  const NetworkId id{identity_.id};
  device::Identity shown;
  shown.model = identity_.model();
  shown.firmware = identity_.firmware_text();
  shown.serial = anchord::to_string(id);
  shown.network_id = id;
  out_.identified(shown);
  if (options_.uwb && !same_air(*options_.uwb, session_->tag.settings())) {
    const Result<UwbSettings> set = co_await session_->tag.set_uwb(*options_.uwb);
    if (!set) co_return set.error();
  }
  if (options_.heading) {
    constexpr std::uint8_t k_ndof = 12;  // fusion with the magnetometer: absolute heading
    const Result<void> set = co_await session_->tag.set_sensors_mode(k_ndof);
    if (!set) out_.dropped("no_compass");
  }
  co_return boost::outcome_v2::success();
}

Script<int> Unit::look_around() {
  // Random slots miss devices: often at first, then once a minute for those that came later.
  constexpr int k_looks = 8;
  const Result<std::vector<std::uint16_t>> found = co_await session_->tag.discover(0, false);
  if (found) co_await adopt(found.value());
  if (!anchors_.empty()) ++looks_;
  look_at_ns_ = session_->wire.now_ns() + (looks_ == 0 ? 1 : looks_ < k_looks ? 2 : 60) * k_s;
  co_return 0;
}

/// Other tags of the kit are in the list too, once somebody asked for all devices: they move, and their
/// ranges are nobody's anchor.
Script<int> Unit::adopt(std::vector<std::uint16_t> found) {
  for (const std::uint16_t id : found) {
    if (anchors_.contains(id)) continue;
    const bool tag = co_await session_->tag.listed_as_tag(id);
    if (!tag) anchors_[id];
  }
  co_return 0;
}

void Unit::failed(Anchor& anchor) {
  if (++anchor.failures < k_failures) return;
  anchor.not_before_ns = session_->wire.now_ns() + k_s;
}

bool Unit::count(const Ranging& ranging) {
  if (!ranging.failure.empty()) {
    if (ranging.failure != "wire") out_.dropped(ranging.failure);
    if (ranging.failure != "wire" && ranging.failure != "refused") out_.heard();
    return false;
  }
  out_.heard();
  if (ranging.fault != RangeFault::none) out_.dropped(to_string(ranging.fault));
  return ranging.good();
}

Script<int> Unit::range_next() {
  const std::int64_t now_ns = session_->wire.now_ns();
  // The next in turn that is due; a turn is at most once round.
  auto next = anchors_.upper_bound(newest_anchor_);
  for (std::size_t i = 0; i < anchors_.size(); ++i, ++next) {
    if (next == anchors_.end()) next = anchors_.begin();
    if (next->second.not_before_ns <= now_ns) break;
  }
  if (anchors_.empty() || next == anchors_.end() || next->second.not_before_ns > now_ns) {
    co_await session_->wire.pause(20'000'000);
    // A silent tag must be noticed even with nobody to range to.
    const Result<Bytes> there = co_await session_->wire.read(reg::who_am_i, 1);
    if (there) out_.heard();
    co_return 0;
  }
  const std::uint16_t id = next->first;
  newest_anchor_ = id;
  const Ranging ranging = co_await session_->tag.range(id);
  if (!count(ranging)) {
    failed(anchors_[id]);
    // Refusals come at once: without a pause they would be asked for as fast as the wire goes.
    if (!ranging.failure.empty()) co_await session_->wire.pause(5'000'000);
    co_return 0;
  }
  anchors_[id] = {};
  std::optional<CirRecord> cir;
  if (options_.cir != CirRead::none) {
    Result<CirRecord> record = co_await session_->tag.read_cir(options_.cir);
    if (record) {
      cir = std::move(record.value());
    } else {
      out_.dropped("no_cir");
    }
  }
  std::optional<double> heading;
  if (options_.heading) {
    const Result<std::optional<double>> read = co_await session_->tag.heading_deg();
    if (read) heading = read.value();
  }
  emit(ranging, id, cir, heading);
  co_return 0;
}

Script<int> Unit::range_anchors() {
  between_at_ns_ = session_->wire.now_ns() + static_cast<std::int64_t>(options_.anchor_anchor_s * 1e9);
  const std::size_t n = anchors_.size();
  if (n < 2) co_return 0;
  do {  // each pair once: from before to
    between_ = (between_ + 1) % (n * n);
  } while (between_ / n >= between_ % n);
  const auto from = std::next(anchors_.begin(), static_cast<std::ptrdiff_t>(between_ / n))->first;
  const auto to = std::next(anchors_.begin(), static_cast<std::ptrdiff_t>(between_ % n))->first;
  const Ranging ranging = co_await session_->tag.range_between(from, to);
  if (count(ranging)) emit_between(ranging, from, to);
  co_return 0;
}

void Unit::emit(const Ranging& ranging, std::uint16_t anchor, const std::optional<CirRecord>& cir,
                std::optional<double> heading_deg) {
  const std::int64_t device_ns = (*unwrap_)(ranging.info.time_ms) * 1'000'000;
  const auto stamp = clock_.stamp(device_ns, ranging.seen_ns);
  // A fit that began anew knows nothing yet: what was known of the clock stays.
  if (clock_.drift_known()) skewed_ = clock_.drift_too_large();
  out_.clock({-clock_.drift() * 1e6, stamp ? stamp->sigma_ns * 1e-9 : 0, clock_.settled(), skewed_});
  Range range;
  range.time = utc_of(stamp ? stamp->ns : ranging.seen_ns);
  range.received = utc_of(ranging.seen_ns);
  range.tag = {identity_.id};
  range.anchor = {anchor};
  range.seq = seq_++;
  range.distance_m = ranging.info.distance_mm * 1e-3;
  range.rss_dbm = ranging.info.rss_dbm;
  range.heading_deg = heading_deg;
  if (cir) {
    const double constant_db = session_->tag.settings().prf == Prf::mhz16 ? 113.77 : 121.74;
    take_record(range, *cir, constant_db);
  }
  out_.emit(std::move(range));
}

void Unit::emit_between(const Ranging& ranging, std::uint16_t from, std::uint16_t to) {
  // Stamped by the clock of the device that ranged, which nobody else hears often enough to model.
  Range range;
  range.kind = RangeKind::anchor_anchor;
  range.time = utc_of(ranging.seen_ns);
  range.received = range.time;
  range.tag = {from};
  range.anchor = {to};
  range.seq = seq_++;
  range.distance_m = ranging.info.distance_mm * 1e-3;
  range.rss_dbm = ranging.info.rss_dbm;
  out_.emit(std::move(range));
}

}  // namespace anchord::pozyx
