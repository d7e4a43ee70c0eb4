#include <nlohmann/json.hpp>

#include "drivers/device/driver.hpp"
#include "drivers/gnss/rover.hpp"
#include "drivers/pozyx/unit.hpp"

// The one place that knows which kinds of devices there are, and the names of their options.

namespace anchord::device {
namespace {

using Json = nlohmann::json;

Error bad(std::string_view option, std::string_view why) {
  return make_error(Errc::invalid_argument, std::string(option) + ": " + std::string(why));
}

Result<std::unique_ptr<Driver>> make_rover(const Json& options, DriverOutput& output) {
  gnss::RoverOptions rover;
  for (const auto& [key, value] : options.items()) {
    if (key == "format") {
      if (value == "auto") continue;
      for (const auto p : {gnss::Protocol::nmea, gnss::Protocol::ubx, gnss::Protocol::erb,
                           gnss::Protocol::llh, gnss::Protocol::gpsd}) {
        if (value == gnss::to_string(p)) rover.format = p;
      }
      if (!rover.format) return bad(key, "one of auto, nmea, ubx, erb, llh, gpsd");
    } else if (key == "gst_order") {
      if (value != "standard" && value != "larger_for_both") return bad(key, "standard or larger_for_both");
      if (value == "standard") rover.gst_order = gnss::nmea::GstOrder::standard;
    } else if (key == "latency_ms") {
      if (!value.is_number() || value.get<double>() < 0 || value.get<double>() > 1000)
        return bad(key, "0 to 1000");
      rover.latency_s = value.get<double>() * 1e-3;
    } else if (key == "gpsd_device") {
      if (!value.is_string() || value.get_ref<const std::string&>().size() > 200) return bad(key, "a path");
      rover.gpsd_device = value.get<std::string>();
    } else {
      return bad(key, "a gnss device has format, gst_order, latency_ms, gpsd_device");
    }
  }
  return std::unique_ptr<Driver>(std::make_unique<gnss::Rover>(std::move(rover), output));
}

}  // namespace

Result<std::unique_ptr<Driver>> make_driver(std::string_view kind, std::string_view options_json,
                                            DriverOutput& output) {
  const auto options = Json::parse(options_json.begin(), options_json.end(), nullptr, false);
  if (!options.is_object()) return bad("options", "must be a JSON object");
  if (kind == "gnss") return make_rover(options, output);
  if (kind == "pozyx") return pozyx::make_unit(options_json, output);
  return make_error(Errc::invalid_argument, "kind: no driver for \"" + std::string(kind) + "\"");
}

}  // namespace anchord::device
