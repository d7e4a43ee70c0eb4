#include <algorithm>
#include <utility>

#include "drivers/gnss/gps_time.hpp"
#include "drivers/gnss/nmea.hpp"

namespace anchord::gnss::nmea {
namespace {

FixClass fix_of_quality(int quality) {
  switch (quality) {
    case 1:
    case 3:
      return FixClass::single;  // 3: PPS, the precise single solution
    case 2:
      return FixClass::dgps;
    case 4:
      return FixClass::rtk_fixed;
    case 5:
      return FixClass::rtk_float;
    default:
      return FixClass::none;  // 6 dead reckoning, 7 manual, 8 simulator, 9 unknown: no measured position
  }
}

FixClass fix_of_mode(char mode) {
  switch (mode) {
    case 0:
    case 'A':
    case 'P':
      return FixClass::single;  // P: the precise single solution, GGA's 3
    case 'D':
      return FixClass::dgps;
    case 'R':
      return FixClass::rtk_fixed;
    case 'F':
      return FixClass::rtk_float;
    default:
      return FixClass::none;
  }
}

std::optional<double> positive(std::optional<double> value) {
  return value && *value > 0 ? value : std::nullopt;  // a sigma of 0 means unknown, not perfect
}

}  // namespace

template <class T>
bool Assembler::put(std::optional<T>& slot, const T& value, Epochs& out) {
  const bool same_time = group_.any && group_.tod_ns == value.tod_ns;
  if (same_time && slot && value.tod_ns) return false;
  if (!same_time || slot) {
    publish(out);
    // `slot` is a member of group_, which publish() has emptied.
    group_.tod_ns = value.tod_ns;
  }
  group_.any = true;
  slot = value;
  return true;
}

bool Assembler::add(const Message& message, Epochs& out) {
  if (const auto* gga = std::get_if<Gga>(&message)) return put(group_.gga, *gga, out);
  if (const auto* gns = std::get_if<Gns>(&message)) return put(group_.gns, *gns, out);
  if (const auto* rmc = std::get_if<Rmc>(&message)) return put(group_.rmc, *rmc, out);
  if (const auto* gst = std::get_if<Gst>(&message)) return put(group_.gst, *gst, out);
  if (const auto* zda = std::get_if<Zda>(&message)) return put(group_.zda, *zda, out);
  if (const auto* gsa = std::get_if<Gsa>(&message)) {
    if (gsa->hdop) group_.hdop = gsa->hdop;  // no time of its own: belongs to what is being collected
  }
  return true;
}

void Assembler::apply_sigmas(const Group& group, Epoch& epoch) {
  if (group.position() == nullptr || !group.tod_ns) return;
  const int quality = group.position()->quality.value_or(0);
  if (group.gst) kept_ = KeptSigmas{*group.gst, *group.tod_ns, quality};
  constexpr std::int64_t k_keep_ns = 2 * k_second_ns;  // Reach: GGA 5 Hz, GST 1 Hz by default
  if (!kept_ || epoch.fix == FixClass::none) return;
  const std::int64_t age_ns = (*group.tod_ns - kept_->tod_ns + k_day_ns) % k_day_ns;
  if (kept_->quality != quality || age_ns > k_keep_ns) return;
  epoch.sigma_n_m = positive(kept_->gst.sigma_lat_m);
  epoch.sigma_e_m = positive(kept_->gst.sigma_lon_m);
  epoch.sigma_u_m = positive(kept_->gst.sigma_height_m);
  if (order_ == GstOrder::larger_for_both && epoch.sigma_n_m && epoch.sigma_e_m) {
    epoch.sigma_n_m = epoch.sigma_e_m = std::max(*epoch.sigma_n_m, *epoch.sigma_e_m);
  }
}

void Assembler::publish(Epochs& out) {
  const Group group = std::exchange(group_, Group{});
  if (!group.any) return;
  std::optional<std::int64_t> days = group.zda ? group.zda->days : std::nullopt;
  if (!days && group.rmc) days = group.rmc->days;
  const auto told =
      days && group.tod_ns ? std::optional(UtcTime{*days * k_day_ns + *group.tod_ns}) : std::nullopt;
  // Without a fix a receiver has the date of its battery or of its first day: it is of this epoch alone,
  // which has no position, and dates no other.
  const Gga* said = group.position();
  const bool sure = said != nullptr ? fix_of_quality(said->quality.value_or(0)) != FixClass::none
                                    : !group.rmc || group.rmc->valid;
  if (told && sure) set_reference(*told);
  if (!group.has_position()) {
    if (group.gst && kept_ && group.tod_ns) kept_ = KeptSigmas{*group.gst, *group.tod_ns, kept_->quality};
    return;
  }

  Epoch epoch;
  if (const Gga* given = group.position()) {
    const Gga& gga = *given;
    epoch.fix = fix_of_quality(gga.quality.value_or(0));
    epoch.satellites = gga.satellites;
    epoch.hdop = gga.hdop ? gga.hdop : group.hdop;
    if (epoch.fix != FixClass::none) {
      epoch.lat_deg = gga.lat_deg;
      epoch.lon_deg = gga.lon_deg;
      epoch.height_msl_m = gga.height_msl_m;
      if (gga.height_msl_m && gga.geoid_separation_m) {
        epoch.height_ellipsoid_m = *gga.height_msl_m + *gga.geoid_separation_m;
      }
      epoch.age_s = gga.age_s;
    }
  } else if (group.rmc) {
    epoch.fix = fix_of_mode(group.rmc->mode);
    epoch.lat_deg = group.rmc->lat_deg;
    epoch.lon_deg = group.rmc->lon_deg;
    epoch.hdop = group.hdop;
  }
  if (!epoch.lat_deg || !epoch.lon_deg) {
    epoch.fix = FixClass::none;
    epoch.lat_deg = epoch.lon_deg = epoch.height_msl_m = epoch.height_ellipsoid_m = std::nullopt;
  }
  apply_sigmas(group, epoch);
  if (told && !sure) epoch.time = told;
  emit(std::move(epoch), group.tod_ns, out);
}

void Assembler::emit(Epoch epoch, std::optional<std::int64_t> tod_ns, Epochs& out) {
  constexpr std::size_t k_max_waiting = 600;  // a minute at 10 Hz
  epoch.protocol = Protocol::nmea;
  epoch.time_of_day_ns = tod_ns;
  if (epoch.time) {
    out.push_back(std::move(epoch));
    return;
  }
  waiting_.push_back(std::move(epoch));
  if (reference_ || waiting_.size() > k_max_waiting) flush(out);
}

void Assembler::flush(Epochs& out) {
  if (reference_) {
    // Backwards from the newest, each next to the one after it: they may span a midnight.
    UtcTime next = *reference_;
    bool newest = true;
    for (auto it = waiting_.rbegin(); it != waiting_.rend(); ++it) {
      Epoch& waited = *it;
      if (!waited.time_of_day_ns) continue;
      waited.time = next = nearest_time_of_day(next, *waited.time_of_day_ns);
      if (std::exchange(newest, false)) reference_ = next;
    }
  }
  for (auto& waited : waiting_) out.push_back(std::move(waited));
  waiting_.clear();
}

void Assembler::set_reference(UtcTime time) { reference_ = time; }

void Assembler::quiet(Epochs& out) {
  if (group_.has_position()) publish(out);
}

void Assembler::finish(Epochs& out) {
  publish(out);
  flush(out);
}

}  // namespace anchord::gnss::nmea
