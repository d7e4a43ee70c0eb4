#include "drivers/gnss/gpsd.hpp"

#include <algorithm>
#include <array>
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
    case 7:
    case 8:
      return FixClass::none;  // dead reckoning, surveyed or typed in, simulated: nothing was measured
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

/// Satellites in use: uSat, or counted where the server (before 3.21) has none.
std::optional<int> satellites_of(const Json& sky) {
  if (const auto used = small_integer(sky, "uSat")) return used;
  const auto list = sky.find("satellites");
  if (list == sky.end() || !list->is_array()) return std::nullopt;
  return static_cast<int>(std::count_if(list->begin(), list->end(), [](const Json& satellite) {
    const auto used = satellite.find("used");  // end() too where it is no object
    return used != satellite.end() && used->is_boolean() && used->get<bool>();
  }));
}

/// A TPV as an epoch. errors: bad_frame (no mode, off the globe).
Result<Epoch> epoch_of(const Json& tpv) {
  const auto mode = small_integer(tpv, "mode");
  if (!mode) return bad("TPV without mode");
  Epoch out;
  out.protocol = Protocol::gpsd;
  out.fix = fix_of(*mode, small_integer(tpv, "status"));
  if (out.fix == FixClass::none) return out;
  out.lat_deg = number(tpv, "lat");
  out.lon_deg = number(tpv, "lon");
  if (!out.lat_deg || !out.lon_deg) {  // some sentences have told the mode before the position
    out.lat_deg = out.lon_deg = std::nullopt;
    out.fix = FixClass::none;
    return out;
  }
  if (std::abs(*out.lat_deg) > 90 || std::abs(*out.lon_deg) > 180)
    return bad("TPV with a position off the globe");
  out.height_ellipsoid_m = number(tpv, "altHAE");  // never "alt": it was either height, by version
  out.height_msl_m = number(tpv, "altMSL");
  out.age_s = number(tpv, "dgpsAge");
  return out;
}

}  // namespace

void Assembler::Device::publish(Epochs& out) {
  auto done = std::exchange(current, std::nullopt);
  if (!done) return;
  done->satellites = satellites;
  done->hdop = hdop;
  published = done->time;
  out.push_back(std::move(*done));
}

void Assembler::Device::merge(const Epoch& report, Epochs& out) {
  if (current && current->time != report.time) publish(out);
  if (!current) {
    if (published == report.time) return;  // a late TPV of an epoch already out
    current = report;
    return;
  }
  // One TPV per sentence: the first may lack height or status. The most complete one wins field by field.
  if (report.fix > current->fix) current->fix = report.fix;
  const auto take = [](std::optional<double>& to, const std::optional<double>& from) {
    if (from) to = from;
  };
  take(current->lat_deg, report.lat_deg);
  take(current->lon_deg, report.lon_deg);
  take(current->height_ellipsoid_m, report.height_ellipsoid_m);
  take(current->height_msl_m, report.height_msl_m);
  take(current->age_s, report.age_s);
}

void Assembler::finish(Epochs& out) {
  for (auto& [path, device] : devices_) device.publish(out);
}

Result<Assembler::Device*> Assembler::device_of(std::optional<std::string> path) {
  constexpr std::size_t k_max_devices = 16;
  if (path) {
    last_ = std::move(*path);
    if (auto unnamed = devices_.extract(""); !unnamed.empty()) {
      unnamed.key() = last_;
      devices_.insert(std::move(unnamed));
    }
  }
  if (devices_.size() >= k_max_devices && devices_.find(last_) == devices_.end())
    return bad("more than 16 devices");
  return &devices_[last_];
}

struct Assembler::Report {
  const Json& json;
  std::string_view kind;

  std::optional<std::string> device() const {
    const auto at = json.find("device");
    if (at == json.end() || !at->is_string()) return std::nullopt;
    return at->get<std::string>();
  }
};

Result<void> Assembler::take(const Report& report, Epochs& out) {
  const Json& json = report.json;
  BOOST_OUTCOME_TRY(auto* known, device_of(report.device()));
  Device& device = *known;
  if (report.kind == "SKY") {
    // Servers since 3.23 tell the DOPs and the satellites in reports of their own.
    if (const auto hdop = number(json, "hdop")) device.hdop = hdop;
    if (const auto satellites = satellites_of(json)) device.satellites = satellites;
    return boost::outcome_v2::success();
  }
  const auto time = time_of(json);
  if (report.kind == "TPV") {
    BOOST_OUTCOME_TRY(auto epoch, epoch_of(json));
    epoch.time = time;
    epoch.receiver = last_;
    if (!time && epoch.fix == FixClass::none) return boost::outcome_v2::success();  // nothing yet
    if (!time) return make_error(Errc::unsupported, "time absent or not readable");
    device.merge(epoch, out);
    return boost::outcome_v2::success();
  }

  auto& current = device.current;
  if (time && current && current->time == time && current->fix != FixClass::none) {
    const auto lat = number(json, "lat"), lon = number(json, "lon"), alt = number(json, "alt");
    // gpsd passes a producer's swapped axes through, so the larger serves for both (see nmea.hpp, GstOrder).
    if (lat && lon && *lat > 0 && *lon > 0) current->sigma_e_m = current->sigma_n_m = std::max(*lat, *lon);
    if (alt && *alt > 0) current->sigma_u_m = alt;
    device.publish(out);
  }
  return boost::outcome_v2::success();
}

Result<void> Assembler::line(std::string_view text, Epochs& out) {
  if (too_deep(text)) return bad("nested too deeply");
  const Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (!json.is_object()) return bad("not a JSON object");
  const auto name = json.find("class");
  if (name == json.end() || !name->is_string()) return bad("no class");
  const auto& kind = name->get_ref<const std::string&>();
  if (kind == "TPV" || kind == "GST" || kind == "SKY") return take({json, kind}, out);
  Result<void> done = boost::outcome_v2::success();
  if (kind != "POLL") return done;
  // An answer to ?POLL holds the newest of each; a GST ends an epoch, so it comes last.
  constexpr std::array<std::pair<const char*, std::string_view>, 3> k_lists{
      {{"sky", "SKY"}, {"tpv", "TPV"}, {"gst", "GST"}}};
  for (const auto& [key, of] : k_lists) {
    const auto list = json.find(key);
    if (list == json.end() || !list->is_array()) continue;
    for (const auto& one : *list) {
      if (!one.is_object()) continue;
      auto taken = take({one, of}, out);
      if (done && !taken) done = std::move(taken);
    }
  }
  return done;
}

}  // namespace anchord::gnss::gpsd
