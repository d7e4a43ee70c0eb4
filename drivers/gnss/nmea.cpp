#include "drivers/gnss/nmea.hpp"

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
  out.quality = f.integer(6);
  if (out.quality.value_or(0) > 0) {  // without a fix some makers print 8960 degrees and minutes here
    out.lat_deg = f.angle(2, 90, 'N', 'S');
    out.lon_deg = f.angle(4, 180, 'E', 'W');
  }
  out.satellites = f.integer(7);
  out.hdop = f.not_negative(8);
  // Heights of another unit than metres, which a few aviation receivers write, are not read as metres.
  for (const std::size_t unit : {10U, 12U})
    if (!f.text(unit).empty() && f.text(unit) != "M") f.fail(unit);
  out.height_msl_m = f.number(9);
  out.geoid_separation_m = f.number(11);
  out.age_s = f.not_negative(13);
  return f.done(out);
}

/// Quality digit of the best mode letter: GPS may be fixed while another system floats along.
std::optional<int> quality_of_modes(std::string_view modes) {
  struct Mode {
    char letter;
    int quality;
  };
  constexpr std::array k_best_first{Mode{'R', 4}, Mode{'F', 5}, Mode{'P', 3}, Mode{'D', 2}, Mode{'A', 1},
                                    Mode{'E', 6}, Mode{'M', 7}, Mode{'S', 8}, Mode{'N', 0}};
  for (const auto& mode : k_best_first) {
    if (modes.find(mode.letter) != std::string_view::npos) return mode.quality;
  }
  return std::nullopt;
}

Result<Message> parse_gns(FieldReader f) {
  Gns out;
  if (f.count() < 13) f.fail(f.count());
  out.tod_ns = f.tod_ns(1);
  out.lat_deg = f.angle(2, 90, 'N', 'S');
  out.lon_deg = f.angle(4, 180, 'E', 'W');
  out.quality = quality_of_modes(f.text(6));
  if (!out.quality && !f.text(6).empty()) f.fail(6);
  out.satellites = f.integer(7);
  out.hdop = f.not_negative(8);
  out.height_msl_m = f.number(9);
  out.geoid_separation_m = f.number(10);
  out.age_s = f.not_negative(11);
  return f.done(out);
}

Result<Message> parse_rmc(FieldReader f) {
  Rmc out;
  if (f.count() < 10) f.fail(f.count());
  out.tod_ns = f.tod_ns(1);
  out.valid = f.text(2) == "A";
  if (out.valid) {
    out.lat_deg = f.angle(3, 90, 'N', 'S');
    out.lon_deg = f.angle(5, 180, 'E', 'W');
  }
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
constexpr std::array k_kinds{Kind{"GGA", parse_gga}, Kind{"GNS", parse_gns}, Kind{"RMC", parse_rmc},
                             Kind{"GST", parse_gst}, Kind{"GSA", parse_gsa}, Kind{"VTG", parse_vtg},
                             Kind{"ZDA", parse_zda}};

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

}  // namespace anchord::gnss::nmea
