#include "drivers/gnss/llh.hpp"

#include <Eigen/LU>
#include <cmath>

#include "drivers/gnss/gps_time.hpp"
#include "drivers/gnss/text.hpp"

namespace anchord::gnss::llh {
namespace {

Error bad(std::string what) { return make_error(Errc::bad_frame, std::move(what)); }

/// Q of RTKLIB, not of NMEA: 4 is DGPS here.
std::optional<FixClass> fix_of(int q) {
  switch (q) {
    case 1:
      return FixClass::rtk_fixed;
    case 2:
      return FixClass::rtk_float;
    case 3:
    case 4:
      return FixClass::dgps;
    case 5:
      return FixClass::single;
    case 6:
      return FixClass::rtk_float;  // PPP: decimetres while it converges, no integers
    case 0:
    case 7:
      return FixClass::none;
    default:
      return std::nullopt;
  }
}

/// yyyy/mm/dd hh:mm:ss.sss
std::optional<std::int64_t> calendar_ns(std::string_view date, std::string_view time) {
  const auto d = split(date, "/", false), t = split(time, ":", false);
  if (d.size() != 3 || t.size() != 3) return std::nullopt;
  const auto year = to_integer(d[0]), month = to_integer(d[1]), day = to_integer(d[2]);
  const auto hour = to_integer(t[0]), minute = to_integer(t[1]);
  const auto second = to_seconds(t[2]);
  if (!year || !month || !day || !hour || !minute || !second) return std::nullopt;
  const auto days = days_from_civil(*year, *month, *day);
  const auto tod = time_of_day_ns(*hour, *minute, second->whole, second->fraction_ns);
  if (!days || !tod) return std::nullopt;
  return *days * k_day_ns + *tod;
}

/// sdne and its sisters are sign(cov) sqrt(|cov|).
double covariance(double signed_root) { return std::copysign(signed_root * signed_root, signed_root); }

std::optional<Eigen::Matrix3d> covariance_enu(const std::vector<double>& v, std::size_t at) {
  const double n = v[at], e = v[at + 1], u = v[at + 2];
  if (!(n > 0) || !(e > 0) || !(u > 0)) return std::nullopt;
  const double ne = covariance(v[at + 3]), eu = covariance(v[at + 4]), un = covariance(v[at + 5]);
  Eigen::Matrix3d out;
  out << e * e, ne, eu, ne, n * n, un, eu, un, u * u;
  // Four decimals round a near-singular matrix over the edge; then the axes alone are used.
  const bool definite = out(0, 0) * out(1, 1) - ne * ne > 0 && out.determinant() > 0;
  if (!definite) return Eigen::Vector3d(e * e, n * n, u * u).asDiagonal().toDenseMatrix();
  return out;
}

/// Digits behind the point.
std::size_t decimals(std::string_view number) {
  const auto point = number.find('.');
  return point == std::string_view::npos ? 0 : number.size() - point - 1;
}

/// A count: tools that rewrite such files print "1.0000000" too.
std::optional<int> whole(double value) {
  if (!(value >= 0 && value <= 1000) || value != std::floor(value)) return std::nullopt;
  return static_cast<int>(value);
}

/// Degrees, minutes, seconds in three columns; the sign is that of the degrees, "-0" included.
std::optional<double> from_dms(std::string_view degrees_text, double degrees, double minutes,
                               double seconds) {
  if (minutes < 0 || minutes >= 60 || seconds < 0 || seconds > 60) return std::nullopt;
  const double size = std::abs(degrees) + minutes / 60 + seconds / 3600;
  return degrees_text.front() == '-' ? -size : size;
}

}  // namespace

void Decoder::header(std::string_view text) {
  const auto has = [&](std::string_view word) { return text.find(word) != std::string_view::npos; };
  if (has("geodetic")) geodetic_height_ = true;
  if (has("ellipsoidal")) geodetic_height_ = false;
  if (has("lat/lon/height=")) other_datum_ = !has("lat/lon/height=WGS84");
  // The line that names the columns, whichever of them there are.
  const bool position = has("latitude("), other = has("x-ecef") || has("e-baseline");
  if (!position && !other) return;
  other_form_ = other;
  column_header_ = true;
  const auto words = split(text.substr(1), " \t,;", true);
  if (words.empty()) return;
  if (words[0] == "GPST")
    system_ = TimeSystem::gpst;
  else if (words[0] == "JST")
    system_ = TimeSystem::jst;
  else if (words[0] == "UTC")
    system_ = TimeSystem::utc;
}

/// Two columns: date and time of day, or GPS week and seconds of it. RTKLIB shifts both forms to the system
/// it names, though its own reader takes the second one for GPS time always.
Result<UtcTime> Decoder::time_of(std::string_view first, std::string_view second) {
  const bool calendar = first.find('/') != std::string_view::npos;
  std::optional<std::int64_t> ns;
  if (calendar) {
    ns = calendar_ns(first, second);
  } else {
    const auto week = to_integer(first);
    const auto seconds = to_seconds(second);
    if (week && *week <= k_last_gps_week && seconds && seconds->whole <= 604'800) {
      ns = gps_week_ns(*week, seconds->whole * k_second_ns + seconds->fraction_ns);
    }
  }
  if (!ns) return bad("time '" + std::string(first) + " " + std::string(second) + "' does not exist");
  if (!system_ && calendar) ++time_assumed_;
  switch (system_.value_or(calendar ? unnamed_ : TimeSystem::gpst)) {
    case TimeSystem::gpst:
      return utc_from_gps(*ns);
    case TimeSystem::jst:
      return UtcTime{*ns - 9 * 3600 * k_second_ns};
    case TimeSystem::utc:
      break;
  }
  return UtcTime{*ns};
}

Result<std::optional<Epoch>> Decoder::line(std::string_view text) {
  if (text.empty()) return std::optional<Epoch>{};
  if (text.front() == '%') {
    header(text);
    return std::optional<Epoch>{};
  }
  if (other_form_)
    return make_error(Errc::unsupported, "ECEF or baseline columns, write latitude and longitude instead");
  if (other_datum_) return make_error(Errc::unsupported, "datum is not WGS84");
  const auto words = split(text, " \t,;", true);
  const std::size_t first = 2;  // after the time, which always has two columns
  if (words.size() < first + 13) {
    return bad(std::to_string(words.size()) + " columns, an LLH line has at least 15");
  }
  std::vector<double> v;
  for (std::size_t i = first; i < words.size(); ++i) {
    const auto value = to_number(words[i]);
    if (!value)
      return bad("column " + std::to_string(i + 1) + " '" + std::string(words[i]) + "' is no number");
    v.push_back(*value);
  }

  Epoch out;
  out.protocol = Protocol::llh;
  // Decimal degrees, or degrees minutes seconds twice: four columns more.
  const bool dms = v.size() == 17 || v.size() == 26;
  const std::size_t at = dms ? 6 : 2;  // index of the height in v
  auto lat = std::optional(v[0]), lon = std::optional(v[1]);
  if (dms) {
    lat = from_dms(words[first], v[0], v[1], v[2]);
    lon = from_dms(words[first + 3], v[3], v[4], v[5]);
  }
  // RTKLIB prints degrees with nine decimals and metres with four: without a header a short baseline would
  // pass for a position near 0 N 0 E, and any table of whole numbers for one too.
  if (!column_header_ && !dms) {
    const auto lat_decimals = decimals(words[first]), lon_decimals = decimals(words[first + 1]);
    if (lat_decimals == 0 || lon_decimals == 0) return bad("degrees without decimals");
    if (lat_decimals == 4 && lon_decimals == 4)
      return make_error(Errc::unsupported, "looks like a baseline, and no header says otherwise");
  }
  if (!lat || !lon || std::abs(*lat) > 90 || std::abs(*lon) > 180)
    return bad("latitude or longitude off the globe");
  if (std::abs(v[at]) > 1e5) return bad("height not believable");
  const auto q = whole(v[at + 1]), satellites = whole(v[at + 2]);
  const auto fix = q ? fix_of(*q) : std::nullopt;
  if (!fix) return bad("Q '" + std::string(words[first + at + 1]) + "' is not 0 to 7");
  if (!satellites || *satellites > 200) return bad("satellites '" + std::string(words[first + at + 2]) + "'");

  BOOST_OUTCOME_TRY(const auto time, time_of(words[0], words[1]));
  out.time = time;
  out.satellites = satellites;
  out.fix = *fix;
  if (*fix == FixClass::none) return std::optional(out);
  out.lat_deg = lat;
  out.lon_deg = lon;
  (geodetic_height_ ? out.height_msl_m : out.height_ellipsoid_m) = v[at];
  if (v[at + 3] > 0) out.sigma_n_m = v[at + 3];
  if (v[at + 4] > 0) out.sigma_e_m = v[at + 4];
  if (v[at + 5] > 0) out.sigma_u_m = v[at + 5];
  out.covariance_enu_m2 = covariance_enu(v, at + 3);
  // RTKLIB prints 0.00 both without corrections and for an age of nothing; only with corrections it is an
  // age.
  if (*fix != FixClass::single && v[at + 9] >= 0) out.age_s = v[at + 9];
  return std::optional(out);
}

}  // namespace anchord::gnss::llh
