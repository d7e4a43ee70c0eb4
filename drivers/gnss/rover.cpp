#include "drivers/gnss/rover.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "drivers/time/time_base.hpp"

namespace anchord::gnss {
namespace {

using device::Arrival;

constexpr std::int64_t k_pause_ns = 30'000'000;  ///< ends a burst: receivers send an epoch in one go
constexpr std::int64_t k_quiet_ns = 50'000'000;  ///< beyond the 16 ms of USB converters and Wi-Fi's jitter
constexpr std::int64_t k_forget_ns = 5'000'000'000;  ///< a format unheard for so long is left for another
constexpr std::int64_t k_undated_ns = 5'000'000'000;
constexpr std::int64_t k_jump_ns = 10'000'000'000;
constexpr std::int64_t k_same_step_ns = 2'000'000'000;

/// How much a format says of one epoch.
int worth(Protocol protocol) {
  switch (protocol) {
    case Protocol::ubx:
      return 5;
    case Protocol::erb:
      return 4;
    case Protocol::llh:
      return 3;
    case Protocol::gpsd:
      return 2;
    case Protocol::nmea:
      return 1;
  }
  return 0;
}

std::string label(std::string_view reason) {
  std::string out;
  for (const char c : reason) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (plain) out += c;
    if (c >= 'A' && c <= 'Z') out += static_cast<char>(c - 'A' + 'a');
    if (c == ' ' && !out.empty() && out.back() != '_') out += '_';
  }
  return out;
}

/// The limits of the front door (api.md): a sum can be right and the number wrong.
bool plausible(const Fix& fix) {
  const auto& p = fix.position;
  return std::isfinite(p.lat_deg) && std::isfinite(p.lon_deg) && std::isfinite(p.height_m) &&
         std::abs(p.lat_deg) <= 90 && std::abs(p.lon_deg) <= 180 && p.height_m >= -500 &&
         p.height_m <= 9000 && (p.lat_deg != 0 || p.lon_deg != 0);
}

device::RoverStatus status_of(const Epoch& epoch) {
  device::RoverStatus out;
  out.time = epoch.time.value_or(UtcTime{});
  out.fix = epoch.fix;
  out.satellites = epoch.satellites;
  out.age_s = epoch.age_s;
  if (epoch.sigma_e_m && epoch.sigma_n_m) out.sigma_h_m = std::max(*epoch.sigma_e_m, *epoch.sigma_n_m);
  out.sigma_v_m = epoch.sigma_u_m;
  out.hdop = epoch.hdop;
  out.height_msl_m = epoch.height_msl_m;
  if (epoch.lat_deg && epoch.lon_deg && epoch.height_ellipsoid_m) {
    out.position = Wgs84{*epoch.lat_deg, *epoch.lon_deg, *epoch.height_ellipsoid_m};
  }
  return out;
}

}  // namespace

Rover::Rover(RoverOptions options, device::DriverOutput& output)
    : options_(std::move(options)), out_(output) {}

void Rover::opened(const Arrival& now) {
  decoder_.emplace(DecoderOptions{options_.format, options_.gst_order, std::nullopt});
  skipped_.clear();
  frames_ = 0;
  greeting_.clear();
  watching_ = false;
  quiet_at_ns_.reset();
  speaks_.reset();
  undated_since_ns_.reset();
  newest_.reset();
  most_ahead_ns_.reset();
  step_ns_.reset();
  burst_ = given_ = now;
  last_ = {};
  receiver_.recording_begins(now.steady_ns);
  out_.unused("");
  if (options_.format == Protocol::gpsd) watch();
}

void Rover::watch() {
  if (std::exchange(watching_, true)) return;
  // A name with a quote in it would end the string; none of gpsd's has one.
  const auto& name = options_.gpsd_device;
  const bool one = !name.empty() && name.find_first_of("\"\\\r\n") == std::string::npos;
  out_.send(R"(?WATCH={"enable":true,"json":true)" + (one ? R"(,"device":")" + name + "\"" : std::string()) +
            "};\n");
}

void Rover::greet_gpsd(std::string_view bytes) {
  if (watching_ || greeting_.size() >= 1024 || (options_.format && options_.format != Protocol::gpsd)) return;
  greeting_ += bytes.substr(0, 1024 - greeting_.size());
  if (greeting_.starts_with('{') && greeting_.find(R"("class":"VERSION")") != std::string::npos) watch();
}

void Rover::bytes(std::string_view bytes, const Arrival& at) {
  if (!decoder_) opened(at);
  if (at.steady_ns - last_.steady_ns > k_pause_ns) burst_ = at;
  last_ = at;
  greet_gpsd(bytes);
  Epochs epochs;
  decoder_->feed(bytes, epochs);
  give(epochs, at);
  quiet_at_ns_ = at.steady_ns + k_quiet_ns;
}

void Rover::tick(const Arrival& now) {
  if (!quiet_at_ns_ || now.steady_ns < *quiet_at_ns_) return;
  quiet_at_ns_.reset();
  Epochs epochs;
  decoder_->quiet(epochs);
  give(epochs, now);
}

void Rover::closed(const Arrival& now) {
  if (!decoder_) return;
  // Half a frame ends here and is gone; what was complete is not.
  Epochs epochs;
  decoder_->finish(epochs);
  give(epochs, now);
  decoder_.reset();
  quiet_at_ns_.reset();
}

void Rover::command(const device::Command& command, const Arrival&) {
  out_.answer(command.id, make_error(Errc::unsupported, "a GNSS receiver does not support the command \"" +
                                                            command.name + "\""));
}

void Rover::count() {
  for (const auto& [reason, entry] : decoder_->skips().entries()) {
    auto& told = skipped_[reason];
    if (entry.count > told) out_.dropped(label(reason), entry.count - told);
    told = entry.count;
  }
  std::uint64_t frames = 0;
  for (const auto p : {Protocol::nmea, Protocol::ubx, Protocol::erb, Protocol::llh, Protocol::gpsd}) {
    frames += decoder_->frames(p);
  }
  if (frames > frames_) out_.heard();
  frames_ = frames;
}

void Rover::give(Epochs& epochs, const Arrival& now) {
  count();
  // An epoch began with its burst; where the wire never pauses, when the one before it was complete.
  const auto& at = burst_.steady_ns > given_.steady_ns ? burst_ : given_;
  bool undated = false;
  for (const auto& epoch : epochs) {
    if (!chosen(epoch, at)) {
      out_.dropped("other_format");
      continue;
    }
    undated = undated || !epoch.time;
    give_one(epoch, at);
  }
  if (!epochs.empty()) given_ = now;
  // NMEA that never says the date: after a while the host's own date serves, nearest to the time of day.
  if (decoder_ && decoder_->frames(Protocol::nmea) > 0 && !newest_) {
    if (!undated_since_ns_) undated_since_ns_ = now.steady_ns;
    if (now.steady_ns - *undated_since_ns_ > k_undated_ns) decoder_->set_reference(now.utc);
  }
}

bool Rover::chosen(const Epoch& epoch, const Arrival& at) {
  const bool free = !speaks_ || at.steady_ns - spoke_ns_ > k_forget_ns;
  if (!free && epoch.protocol != *speaks_ && worth(epoch.protocol) <= worth(*speaks_)) return false;
  if (speaks_ != epoch.protocol) {
    speaks_ = epoch.protocol;
    device::Identity identity;
    identity.model = "GNSS receiver (" + std::string(to_string(epoch.protocol)) + ")";
    if (identity_ != identity) out_.identified(identity);
    identity_ = identity;
  }
  spoke_ns_ = at.steady_ns;
  return true;
}

/// One epoch that is 10 s and more ahead of all before, or behind the newest, is another receiver's or
/// damaged; a receiver that sets its clock says so with the next one too. Epochs that waited on the way are
/// neither.
bool Rover::is_lone_step(UtcTime measured, const Arrival& at) {
  const std::int64_t offset_ns = measured.ns - at.steady_ns;
  const bool ahead = most_ahead_ns_ && offset_ns - *most_ahead_ns_ > k_jump_ns;
  const bool behind = newest_ && newest_->ns - measured.ns >= k_jump_ns;
  if (!ahead && !behind) {
    step_ns_.reset();
    most_ahead_ns_ = std::max(most_ahead_ns_.value_or(offset_ns), offset_ns);
    return false;
  }
  const auto former = std::exchange(step_ns_, offset_ns);
  if (!former || std::abs(offset_ns - *former) > k_same_step_ns) return true;
  step_ns_.reset();
  most_ahead_ns_ = offset_ns;
  return false;
}

void Rover::give_one(const Epoch& epoch, const Arrival& at) {
  if (epoch.fix == FixClass::none) {
    if (!receiver_.may_be(epoch.receiver)) return out_.dropped("other_source");
    // Its clock runs on a battery, or from the first second of 1980: no time of it counts, only that it is
    // there.
    auto status = status_of(epoch);
    if (!epoch.time) status.time = out_.time().utc_of(at.steady_ns).time;
    out_.rover(status);
    return out_.dropped("no_fix");
  }
  if (!epoch.time) return out_.dropped("no_time");
  if (!receiver_.takes(epoch.receiver, epoch.fix >= FixClass::rtk_float, at.steady_ns, true)) {
    const std::string why = "this gpsd has several receivers: the positions of " + *receiver_.used() +
                            " are the track, those of " + epoch.receiver +
                            " are not stored. Name the one on the aircraft in the setting gpsd_device";
    out_.unused(why);
    return out_.dropped("other_source");
  }
  if (newest_ && epoch.time->ns <= newest_->ns && newest_->ns - epoch.time->ns < k_jump_ns) {
    return out_.dropped(epoch.time == newest_ ? "repeated_epoch" : "out_of_order");
  }
  if (is_lone_step(*epoch.time, at)) return out_.dropped("time_step");
  newest_ = epoch.time;
  const auto belief = out_.time().receiver_said(out_.slot(), *epoch.time, at, options_.latency_s);
  out_.notice(out_.time().doubt(out_.slot()).value_or(""));
  out_.rover(status_of(epoch));
  if (belief != timing::Belief::believed) {
    most_ahead_ns_.reset();
    return out_.dropped("date_not_believed");
  }
  auto fix = to_fix(epoch, MissionId{});
  if (!fix) return out_.dropped("no_ellipsoidal_height");
  if (!plausible(*fix)) return out_.dropped("implausible_position");
  fix->received = out_.time().utc_of(at.steady_ns).time;
  fix->seq = seq_++;
  out_.emit(std::move(*fix));
}

}  // namespace anchord::gnss
