#include "drivers/device/pipeline.hpp"

#include <utility>

#include "core/base/text.hpp"
#include "drivers/device/settings.hpp"

namespace anchord::device {

namespace {

constexpr std::size_t k_most_word = 200, k_most_reason = 10'000;
constexpr std::string_view k_other_receiver =
    "another receiver gives the track: the positions of this one are not stored. Switch off the one whose "
    "antenna is not on the aircraft";
constexpr std::string_view k_other_caster =
    "another source gives the corrections: those of this one are not used. Switch off the one that is not "
    "wanted";

/// The wire says microseconds, and a row's time is part of its identity: one that is sent again, by a replay
/// or by another program, must be the row that was stored.
template <class Row>
void in_microseconds(Row& row) {
  row.time.ns -= row.time.ns % 1000;
  if (row.received) row.received->ns -= row.received->ns % 1000;
}

/// Databases know one zero; receivers send two (covariances that are not there but for their sign).
void with_one_zero(Fix& fix) {
  if (fix.covariance_m2) fix.covariance_m2->array() += 0.0;
}

}  // namespace

class Pipeline::Device final : public DriverOutput {
 public:
  Device(Pipeline& owner, std::uint16_t slot, Settings settings, std::string json)
      : owner_(owner), slot_(slot), settings_(std::move(settings)), json_(std::move(json)) {}

  Result<void> make() {
    BOOST_OUTCOME_TRY(driver_, make_driver(settings_, *this));
    return boost::outcome_v2::success();
  }
  Driver& driver() { return *driver_; }
  const Driver& driver() const { return *driver_; }
  const Settings& settings() const { return settings_; }
  const std::string& json() const { return json_; }

  void ensure_open(const Arrival& at) {
    if (open_) return;
    open_ = true;
    driver_->opened(at);
  }
  void close(const Arrival& at) {
    if (!std::exchange(open_, false)) return;
    driver_->closed(at);
    say_unused({});  // what gives nothing is not left out
  }
  bool is_open() const { return open_; }

  void send(std::string_view bytes) override { owner_.sink_.send(slot_, bytes); }
  void emit(Fix fix) override {
    const bool rtk = fix.fix >= FixClass::rtk_float;
    const bool mine = owner_.track_.takes(slot_, rtk, owner_.now_ns_, owner_.records());
    say_unused(mine ? std::string_view() : k_other_receiver);
    if (!mine && owner_.records()) return owner_.sink_.dropped(slot_, "other_source", 1);
    fix.mission = owner_.mission_;
    in_microseconds(fix);
    with_one_zero(fix);
    owner_.sink_.fix(slot_, fix);
  }
  void emit(Range range) override {
    range.mission = owner_.mission_;
    in_microseconds(range);
    owner_.sink_.range(slot_, range);
  }
  void rover(const RoverStatus& status) override {
    if (status.position && owner_.track_.may_be(slot_)) owner_.rover_ = status;
    owner_.sink_.rover(slot_, status);
  }
  // The door of every driver: whatever a device said, its words go on as UTF-8 and bounded.
  void identified(const Identity& identity) override {
    Identity clean = identity;
    for (auto* word : {&clean.model, &clean.firmware, &clean.serial}) *word = to_utf8(*word, k_most_word);
    owner_.sink_.identified(slot_, clean);
  }
  void clock(const ClockReading& reading) override { owner_.sink_.clock(slot_, reading); }
  void base(const BaseStation& station) override { owner_.sink_.base(slot_, station); }
  void heard() override { owner_.sink_.heard(slot_); }
  void dropped(std::string_view reason, std::uint64_t n) override {
    owner_.sink_.dropped(slot_, to_utf8(reason, k_most_word), n);
  }
  void notice(std::string_view text) override { owner_.sink_.notice(slot_, to_utf8(text, k_most_reason)); }
  void unused(std::string_view why) override {
    by_driver_ = to_utf8(why, k_most_reason);
    tell();
  }
  void answer(std::uint64_t id, Result<std::string> json) override {
    if (!json) json = make_error(json.error().code, to_utf8(json.error().message));
    owner_.sink_.answer(slot_, id, json);
  }
  void corrections(std::string_view bytes) override {
    const bool mine = owner_.corrections_.takes(slot_, true, owner_.now_ns_, owner_.records());
    say_unused(mine ? std::string_view() : k_other_caster);
    if (!mine) return owner_.sink_.dropped(slot_, "other_source", 1);
    owner_.correct(bytes);
  }
  void hang_up(std::string_view why, std::int64_t wait_ns) override {
    owner_.sink_.hang_up(slot_, to_utf8(why, k_most_reason), wait_ns);
  }
  std::optional<RoverStatus> rover_position() const override { return owner_.rover_; }
  timing::TimeBase& time() override { return owner_.time_; }
  std::uint16_t slot() const override { return slot_; }

 private:
  void say_unused(std::string_view why) {
    if (std::exchange(unused_, why) != why) tell();
  }
  void tell() { owner_.sink_.unused(slot_, unused_.empty() ? std::string_view(by_driver_) : unused_); }

  Pipeline& owner_;
  std::uint16_t slot_;
  std::string by_driver_;      ///< why a part of what it gives is not used; empty: all is
  std::string_view unused_{};  ///< the same, beside other devices
  Settings settings_;
  std::string json_;
  std::unique_ptr<Driver> driver_;
  bool open_{false};
};

Pipeline::Pipeline(PipelineSink& sink) : sink_(sink) {}
Pipeline::~Pipeline() = default;

Result<void> Pipeline::add(std::uint16_t slot, std::string_view json) {
  const auto known = devices_.find(slot);
  // Each part of a recording tells again what is there.
  if (known != devices_.end() && known->second->json() == json) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(auto settings, parse_settings(json));
  auto device = std::make_unique<Device>(*this, slot, std::move(settings), std::string(json));
  BOOST_OUTCOME_TRY(device->make());
  devices_[slot] = std::move(device);
  return boost::outcome_v2::success();
}

void Pipeline::correct(std::string_view bytes) {
  for (const auto& [slot, device] : devices_) {
    if (device->is_open() && device->driver().takes_corrections()) sink_.send(slot, bytes);
  }
}

std::optional<std::int64_t> Pipeline::deadline_ns(std::uint16_t slot) const {
  const auto found = devices_.find(slot);
  return found == devices_.end() || !found->second->is_open() ? std::nullopt
                                                              : found->second->driver().deadline_ns();
}

Result<void> Pipeline::take(const record::Event& event) {
  using record::EventKind;
  time_.arrived(event.at);
  now_ns_ = event.at.steady_ns;
  if (event.kind == EventKind::added) return add(event.slot, event.payload);
  if (event.kind == EventKind::mission) {
    if (event.payload.empty()) {
      mission_ = {};
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(const auto id, parse_uuid(event.payload));
    mission_ = MissionId{id};
    track_.recording_begins(now_ns_);
    corrections_.recording_begins(now_ns_);
    return boost::outcome_v2::success();
  }
  const auto found = devices_.find(event.slot);
  if (found == devices_.end()) {
    return make_error(Errc::not_found, "no device in slot " + std::to_string(event.slot));
  }
  auto& device = *found->second;
  switch (event.kind) {
    case EventKind::opened:
      device.close(event.at);  // a listening link's next peer
      device.ensure_open(event.at);
      break;
    case EventKind::bytes:
      device.ensure_open(event.at);
      device.driver().bytes(event.payload, event.at);
      break;
    case EventKind::tick:
      device.ensure_open(event.at);
      device.driver().tick(event.at);
      break;
    case EventKind::closed:
      device.close(event.at);
      time_.receiver_gone(event.slot);
      break;
    case EventKind::command: {
      BOOST_OUTCOME_TRY(const auto command, parse_command(event.payload));
      device.driver().command(command, event.at);
      break;
    }
    case EventKind::removed:
      device.close(event.at);
      time_.receiver_gone(event.slot);
      track_.gone(event.slot);
      corrections_.gone(event.slot);
      devices_.erase(found);
      break;
    case EventKind::added:
    case EventKind::mission:
      break;
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::device
