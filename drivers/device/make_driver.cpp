#include <algorithm>
#include <nlohmann/json.hpp>

#include "drivers/dwm1001/tag.hpp"
#include "drivers/gnss/rover.hpp"
#include "drivers/link/address.hpp"
#include "drivers/mapping/ndjson.hpp"
#include "drivers/mqtt/subscriber.hpp"
#include "drivers/ntrip/client.hpp"
#include "drivers/port/driver.hpp"
#include "drivers/pozyx/unit.hpp"

// The one place that knows which kinds of devices there are, and the names of their options.

namespace anchord::device {
namespace {

using Json = nlohmann::json;

Error bad(std::string_view option, std::string_view why) {
  return make_error(Errc::invalid_argument, std::string(option) + ": " + std::string(why));
}

/// Empty where it is no text, which no option may be.
std::string_view text_of(const Json& value) {
  return value.is_string() ? std::string_view(value.get_ref<const std::string&>()) : std::string_view();
}

Result<std::unique_ptr<Driver>> make_rover(const Json& options, DriverOutput& output) {
  gnss::RoverOptions rover;
  for (const auto& [key, value] : options.items()) {
    if (key == "format") {
      if (value == "auto") continue;
      rover.format = gnss::k_protocol_words.find(text_of(value));
      if (!rover.format) return bad(key, "must be one of auto, " + list_of(gnss::k_protocol_words.words()));
    } else if (key == "gst_order") {
      const auto order = gnss::nmea::k_gst_order_words.find(text_of(value));
      if (!order) return bad(key, "must be one of " + list_of(gnss::nmea::k_gst_order_words.words()));
      rover.gst_order = *order;
    } else if (key == "latency_ms") {
      if (!value.is_number() || value.get<double>() < 0 || value.get<double>() > 1000)
        return bad(key, "must be 0 to 1000");
      rover.latency_s = value.get<double>() * 1e-3;
    } else if (key == "gpsd_device") {
      if (!value.is_string() || value.get_ref<const std::string&>().size() > 200)
        return bad(key, "must be a path");
      rover.gpsd_device = value.get<std::string>();
    } else if (key == "corrections") {
      if (value != "own" && value != "ntrip") return bad(key, "must be own or ntrip");
      rover.takes_corrections = value == "ntrip";
    } else {
      return bad(key,
                 "no such option: a gnss device has format, gst_order, latency_ms, gpsd_device, corrections");
    }
  }
  return std::unique_ptr<Driver>(std::make_unique<gnss::Rover>(std::move(rover), output));
}

/// A word of a request line or header: printable, without blanks, so that it ends neither.
bool plain(const Json& value, std::size_t most) {
  if (!value.is_string() || value.get_ref<const std::string&>().size() > most) return false;
  const auto& text = value.get_ref<const std::string&>();
  return std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < 0x7f; });
}

Result<std::unique_ptr<Driver>> make_caster_client(const Json& options, std::string_view address,
                                                   DriverOutput& output) {
  ntrip::ClientOptions client;
  for (const auto& [key, value] : options.items()) {
    if (key == "mount") {
      if (!plain(value, 200) || value == "") return bad(key, "must be the name of a mount point");
      client.mount = value.get<std::string>();
    } else if (key == "user") {
      if (!value.is_string() || value.get_ref<const std::string&>().size() > 200)
        return bad(key, "must be a name");
      client.user = value.get<std::string>();
    } else if (key == "password_file") {
      if (!value.is_string() || value.get_ref<const std::string&>().size() > 1000)
        return bad(key, "must be a path");
      client.password_file = value.get<std::string>();
    } else if (key == "version") {
      if (value != 1 && value != 2) return bad(key, "must be 1 or 2");
      client.version = value.get<int>();
    } else if (key == "send_gga") {
      if (!value.is_boolean()) return bad(key, "must be true or false");
      client.send_gga = value.get<bool>();
    } else {
      return bad(key, "no such option: an ntrip device has mount, user, password_file, version, send_gga");
    }
  }
  if (client.mount.empty()) return bad("mount", "is missing: give the caster's mount point");
  if (const auto where = link::parse_address(address); where && where.value().kind == link::Kind::tcp)
    client.host = where.value().host + ":" + std::to_string(where.value().port);
  return std::unique_ptr<Driver>(std::make_unique<ntrip::Client>(std::move(client), output));
}

/// Of a driver that is made to see whether it can be.
class Unheard final : public DriverOutput {
 public:
  void send(std::string_view) override {}
  void emit(Fix) override {}
  void emit(Range) override {}
  void rover(const RoverStatus&) override {}
  void identified(const Identity&) override {}
  void heard() override {}
  void dropped(std::string_view, std::uint64_t) override {}
  void answer(std::uint64_t, Result<std::string>) override {}
  void corrections(std::string_view) override {}
  void hang_up(std::string_view, std::int64_t) override {}
  std::optional<RoverStatus> rover_position() const override { return std::nullopt; }
  timing::TimeBase& time() override { return time_; }
  std::uint16_t slot() const override { return 0; }

 private:
  timing::TimeBase time_;
};

}  // namespace

Result<std::unique_ptr<Driver>> make_driver(const Settings& settings, DriverOutput& output) {
  const auto& [id, kind, name, address, options_json] = settings;
  const auto options = Json::parse(options_json.begin(), options_json.end(), nullptr, false);
  if (!options.is_object()) return bad("options", "must be a JSON object");
  if (kind == "gnss") return make_rover(options, output);
  if (kind == "ntrip") return make_caster_client(options, address, output);
  if (kind == "pozyx") return pozyx::make_unit(options_json, output);
  if (kind == "dwm1001") return dwm1001::make_tag(options_json, output);
  if (kind == "mqtt") return mqtt::make_subscriber(options_json, id, output);
  if (kind == "ndjson") {
    const auto where = link::parse_address(address);
    return mapping::make_ndjson(options_json, where && where.value().kind == link::Kind::udp, output);
  }
  return make_error(Errc::invalid_argument, "kind: no driver for \"" + kind + "\"");
}

Result<void> check_settings(const Settings& settings) {
  BOOST_OUTCOME_TRYV(link::parse_address(settings.address));
  Unheard output;
  BOOST_OUTCOME_TRYV(make_driver(settings, output));
  return boost::outcome_v2::success();
}

}  // namespace anchord::device
