#include "drivers/gnss/gpsd.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "drivers/gnss/gps_time.hpp"

namespace anchord::gnss::gpsd {
namespace {

using Json = nlohmann::json;

std::optional<double> number(const Json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end() || !it->is_number()) return std::nullopt;
  const double value = it->get<double>();
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::optional<int> small_integer(const Json& object, const char* key) {
  const auto value = number(object, key);
  if (!value || *value < 0 || *value > 1000 || *value != std::floor(*value)) return std::nullopt;
  return static_cast<int>(*value);
}

std::optional<UtcTime> time_of(const Json& object) {
  const auto it = object.find("time");
  if (it == object.end() || !it->is_string()) return std::nullopt;
  const auto time = parse_rfc3339(it->get_ref<const std::string&>());
  return time ? std::optional(time.value()) : std::nullopt;
}

/// 3 is fixed and 4 float, the other way round than NMEA's 4 and 5; absent is a plain position.
FixClass fix_of(int mode, std::optional<int> status) {
  if (mode < 2) return FixClass::none;
  switch (status.value_or(1)) {
    case 2:
      return FixClass::dgps;
    case 3:
      return FixClass::rtk_fixed;
    case 4:
      return FixClass::rtk_float;
    case 5:
    case 8:
      return FixClass::none;  // dead reckoning, simulated
    default:
      return FixClass::single;
  }
}

Error bad(std::string what) { return make_error(Errc::bad_frame, std::move(what)); }

/// Deepest nesting of a gpsd report is 3; a bracket bomb must not reach the parser's recursion.
bool too_deep(std::string_view text) {
  int depth = 0, deepest = 0;
  for (const char c : text) {
    depth += (c == '{' || c == '[') - (c == '}' || c == ']');
    deepest = std::max(deepest, depth);
  }
  return deepest > 16;
}

}  // namespace

void Assembler::publish(Epochs& out) {
  if (!current_) return;
  current_->satellites = satellites_;
  current_->hdop = hdop_;
  published_ = current_->time;
  out.push_back(*std::exchange(current_, std::nullopt));
}

void Assembler::merge(const Epoch& report, Epochs& out) {
  if (current_ && current_->time != report.time) publish(out);
  if (!current_) {
    if (published_ == report.time) return;  // a late TPV of an epoch already out
    current_ = report;
    return;
  }
  // One TPV per sentence: the first may lack height or status. The most complete one wins field by field.
  if (report.fix > current_->fix) current_->fix = report.fix;
  const auto take = [](std::optional<double>& to, const std::optional<double>& from) {
    if (from) to = from;
  };
  take(current_->lat_deg, report.lat_deg);
  take(current_->lon_deg, report.lon_deg);
  take(current_->height_ellipsoid_m, report.height_ellipsoid_m);
  take(current_->height_msl_m, report.height_msl_m);
  take(current_->age_s, report.age_s);
}

Result<void> Assembler::line(std::string_view text, Epochs& out) {
  if (too_deep(text)) return bad("nested too deeply");
  const Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (!json.is_object()) return bad("not a JSON object");
  const auto name = json.find("class");
  if (name == json.end() || !name->is_string()) return bad("no class");
  const auto& kind = name->get_ref<const std::string&>();

  if (kind == "SKY") {
    hdop_ = number(json, "hdop");
    if (const auto used = small_integer(json, "uSat")) satellites_ = used;
    return boost::outcome_v2::success();
  }
  if (kind != "TPV" && kind != "GST") return boost::outcome_v2::success();
  const auto time = time_of(json);
  if (!time) return boost::outcome_v2::success();  // no fix yet, or a position without a date: of no use

  if (kind == "TPV") {
    const auto mode = small_integer(json, "mode");
    if (!mode) return bad("TPV without mode");
    Epoch report;
    report.protocol = Protocol::gpsd;
    report.time = time;
    report.fix = fix_of(*mode, small_integer(json, "status"));
    if (report.fix != FixClass::none) {
      report.lat_deg = number(json, "lat");
      report.lon_deg = number(json, "lon");
      report.height_ellipsoid_m = number(json, "altHAE");  // never "alt": it was either height, by version
      report.height_msl_m = number(json, "altMSL");
      report.age_s = number(json, "dgpsAge");
      if (!report.lat_deg || !report.lon_deg || std::abs(*report.lat_deg) > 90 ||
          std::abs(*report.lon_deg) > 180) {
        return bad("TPV without a position on the globe");
      }
    }
    merge(report, out);
    return boost::outcome_v2::success();
  }

  if (current_ && current_->time == time && current_->fix != FixClass::none) {
    const auto lat = number(json, "lat"), lon = number(json, "lon"), alt = number(json, "alt");
    // gpsd passes a producer's swapped axes through, so the larger serves for both (see nmea.hpp, GstOrder).
    if (lat && lon && *lat > 0 && *lon > 0) current_->sigma_e_m = current_->sigma_n_m = std::max(*lat, *lon);
    if (alt && *alt > 0) current_->sigma_u_m = alt;
    publish(out);
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::gnss::gpsd
