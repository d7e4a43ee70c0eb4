#include "drivers/gnss/nmea.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "drivers/gnss/gps_time.hpp"
#include "drivers/gnss/text.hpp"

namespace anchord::gnss::nmea {
namespace {

constexpr double k_mps_per_knot = 1852.0 / 3600.0;  // by definition of the nautical mile

/// Reads fields by number; the first one that is neither empty nor right makes the whole sentence an error.
class FieldReader {
 public:
  explicit FieldReader(std::string_view sentence) : fields_(split(sentence, ",", false)) {}

  std::string_view text(std::size_t i) const { return i < fields_.size() ? fields_[i] : std::string_view{}; }
  std::size_t count() const { return fields_.size(); }

  std::optional<double> number(std::size_t i) { return checked(i, to_number(text(i))); }
  std::optional<double> not_negative(std::size_t i) {
    const auto value = number(i);
    if (value && *value < 0) bad_ = i;
    return value;
  }
  std::optional<int> integer(std::size_t i) { return checked(i, to_integer(text(i))); }

  /// ddmm.mmmm or dddmm.mmmm with its hemisphere in the next field.
  std::optional<double> angle(std::size_t i, double limit_deg, char positive, char negative) {
    const auto value = number(i);
    if (!value) return std::nullopt;
    const double degrees = std::floor(*value / 100), minutes = *value - 100 * degrees;
    const auto side = text(i + 1);
    const double out = degrees + minutes / 60;
    if (*value < 0 || minutes >= 60 || out > limit_deg || side.size() != 1 ||
        (side[0] != positive && side[0] != negative)) {
      bad_ = i;
      return std::nullopt;
    }
    return side[0] == negative ? -out : out;
  }

  /// hhmmss or hhmmss.sss
  std::optional<std::int64_t> tod_ns(std::size_t i) {
    const auto value = text(i);
    if (value.empty()) return std::nullopt;
    std::optional<std::int64_t> out;
    if (value.size() >= 6 && (value.size() == 6 || value[6] == '.')) {
      const auto h = to_integer(value.substr(0, 2)), m = to_integer(value.substr(2, 2));
      const auto s = to_seconds(value.substr(4));
      if (h && m && s) out = time_of_day_ns(*h, *m, s->whole, s->fraction_ns);
    }
    if (!out) bad_ = i;
    return out;
  }

  std::optional<std::int64_t> days(std::optional<int> day, std::optional<int> month, std::optional<int> year,
                                   std::size_t i) {
    if (!day || !month || !year) return std::nullopt;
    const auto out = days_from_civil(*year, *month, *day);
    if (!out) bad_ = i;
    return out;
  }
  void fail(std::size_t i) { bad_ = i; }

  template <class T>
  Result<Message> done(T message) const {
    if (bad_) {
      return make_error(Errc::bad_frame,
                        "field " + std::to_string(*bad_) + " '" + std::string(text(*bad_)) + "'");
    }
    return Message(std::move(message));
  }

 private:
  template <class T>
  std::optional<T> checked(std::size_t i, std::optional<T> value) {
    if (!value && !text(i).empty()) bad_ = i;
    return value;
  }
  std::vector<std::string_view> fields_;
  std::optional<std::size_t> bad_;
};

Result<Message> parse_gga(FieldReader f) {
  Gga out;
  if (f.count() < 13) f.fail(f.count());
  out.tod_ns = f.tod_ns(1);
  out.lat_deg = f.angle(2, 90, 'N', 'S');
  out.lon_deg = f.angle(4, 180, 'E', 'W');
  out.quality = f.integer(6);
  out.satellites = f.integer(7);
  out.hdop = f.not_negative(8);
  out.height_msl_m = f.number(9);
  out.geoid_separation_m = f.number(11);
  out.age_s = f.not_negative(13);
  return f.done(out);
}

Result<Message> parse_rmc(FieldReader f) {
  Rmc out;
  if (f.count() < 10) f.fail(f.count());
  out.tod_ns = f.tod_ns(1);
  out.valid = f.text(2) == "A";
  out.lat_deg = f.angle(3, 90, 'N', 'S');
  out.lon_deg = f.angle(5, 180, 'E', 'W');
  if (const auto knots = f.not_negative(7)) out.speed_mps = *knots * k_mps_per_knot;
  out.course_deg = f.number(8);
  if (const auto date = f.text(9); !date.empty()) {
    const auto d = to_integer(date.substr(0, 2)), m = to_integer(date.size() == 6 ? date.substr(2, 2) : "");
    const auto y = to_integer(date.size() == 6 ? date.substr(4, 2) : "");
    // Two digits: GPS began in 1980.
    out.days = f.days(d, m, y ? std::optional(*y + (*y < 80 ? 2000 : 1900)) : std::nullopt, 9);
    if (!out.days) f.fail(9);
  }
  if (!f.text(12).empty()) out.mode = f.text(12)[0];
  return f.done(out);
}

Result<Message> parse_gst(FieldReader f) {
  Gst out;
  if (f.count() < 9) f.fail(f.count());
  out.tod_ns = f.tod_ns(1);
  out.sigma_lat_m = f.not_negative(6);
  out.sigma_lon_m = f.not_negative(7);
  out.sigma_height_m = f.not_negative(8);
  return f.done(out);
}

Result<Message> parse_gsa(FieldReader f) {
  if (f.count() < 18) f.fail(f.count());
  return f.done(Gsa{f.not_negative(15), f.not_negative(16), f.not_negative(17)});
}

Result<Message> parse_vtg(FieldReader f) {
  Vtg out;
  out.course_deg = f.number(1);
  if (const auto kmh = f.not_negative(7)) out.speed_mps = *kmh / 3.6;
  return f.done(out);
}

Result<Message> parse_zda(FieldReader f) {
  Zda out;
  out.tod_ns = f.tod_ns(1);
  out.days = f.days(f.integer(2), f.integer(3), f.integer(4), 4);
  return f.done(out);
}

struct Kind {
  std::string_view name;
  Result<Message> (*parse)(FieldReader);
};
constexpr std::array k_kinds{Kind{"GGA", parse_gga}, Kind{"RMC", parse_rmc}, Kind{"GST", parse_gst},
                             Kind{"GSA", parse_gsa}, Kind{"VTG", parse_vtg}, Kind{"ZDA", parse_zda}};

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
      return FixClass::single;
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

Result<Message> parse(std::string_view sentence) {
  const auto name = sentence.substr(0, sentence.find(','));
  if (name.size() == 5) {
    for (const auto& kind : k_kinds) {
      if (name.substr(2) == kind.name) return kind.parse(FieldReader(sentence));
    }
  }
  return Message(Other{});
}

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
  if (const auto* rmc = std::get_if<Rmc>(&message)) return put(group_.rmc, *rmc, out);
  if (const auto* gst = std::get_if<Gst>(&message)) return put(group_.gst, *gst, out);
  if (const auto* zda = std::get_if<Zda>(&message)) return put(group_.zda, *zda, out);
  if (const auto* gsa = std::get_if<Gsa>(&message)) {
    if (gsa->hdop) group_.hdop = gsa->hdop;  // no time of its own: belongs to what is being collected
  }
  return true;
}

void Assembler::apply_sigmas(const Group& group, Epoch& epoch) {
  if (!group.gga || !group.tod_ns) return;
  const int quality = group.gga->quality.value_or(0);
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
  if (days && group.tod_ns) set_reference({*days * k_day_ns + *group.tod_ns});
  if (!group.gga && !(group.rmc && group.rmc->valid)) {
    if (group.gst && kept_ && group.tod_ns) kept_ = KeptSigmas{*group.gst, *group.tod_ns, kept_->quality};
    return;
  }

  Epoch epoch;
  if (group.gga) {
    const Gga& gga = *group.gga;
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
  } else {
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
  emit(std::move(epoch), group.tod_ns, out);
}

void Assembler::emit(Epoch epoch, std::optional<std::int64_t> tod_ns, Epochs& out) {
  constexpr std::size_t k_max_waiting = 600;  // a minute at 10 Hz
  epoch.protocol = Protocol::nmea;
  epoch.time_of_day_ns = tod_ns;
  waiting_.push_back(std::move(epoch));
  if (reference_ || waiting_.size() > k_max_waiting) flush(out);
}

void Assembler::flush(Epochs& out) {
  if (reference_) {
    // Backwards from the newest, each next to the one after it: they may span a midnight.
    UtcTime next = *reference_;
    bool newest = true;
    for (auto it = waiting_.rbegin(); it != waiting_.rend(); ++it) {
      if (!it->time_of_day_ns) continue;
      it->time = next = nearest_time_of_day(next, *it->time_of_day_ns);
      if (std::exchange(newest, false)) reference_ = next;
    }
  }
  for (auto& waited : waiting_) out.push_back(std::move(waited));
  waiting_.clear();
}

void Assembler::set_reference(UtcTime time) { reference_ = time; }

void Assembler::quiet(Epochs& out) {
  if (group_.gga || (group_.rmc && group_.rmc->valid)) publish(out);
}

void Assembler::finish(Epochs& out) {
  publish(out);
  flush(out);
}

}  // namespace anchord::gnss::nmea
