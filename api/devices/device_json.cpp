#include "api/devices/device_json.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::array<std::string_view, 6> k_kinds{"gnss", "pozyx", "ntrip", "mqtt", "ndjson", "dwm1001"};

Ordered network_id(const DeviceReport& d) {
  return d.network_id ? Ordered(to_string(*d.network_id)) : Ordered(nullptr);
}

/// A secret is a value that comes and never goes back. A file of the server is not named over REST: whoever
/// may set up devices must not be able to have any file read and sent to an address of his choice.
void check_secret(const Json& options, Json& merged, std::vector<FieldError>& errors) {
  if (options.contains("password_file")) {
    errors.push_back(
        {"/options/password_file", "refused",
         "a path of the server cannot be given over REST: send the password itself as options.password; it "
         "is kept in a file that only the server can read, and is never returned"});
  }
  const auto given = options.find("password");
  if (given == options.end()) return;
  if (given->is_null()) {
    merged["password"] = "";  // in a merge patch null removes: the server forgets the one it has
    return;
  }
  const auto* text = given->is_string() ? given->get_ptr<const Json::string_t*>() : nullptr;
  const bool plain =
      text != nullptr && text->size() <= 200 &&
      std::none_of(text->begin(), text->end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  if (!plain)
    errors.push_back({"/options/password", "out_of_range",
                      "must be a string of at most 200 bytes without control characters; empty removes it"});
}

}  // namespace

Ordered device_json(const DeviceReport& d) {
  Ordered out{{"id", to_string(d.config.id)},
              {"kind", d.config.kind},
              {"name", d.config.name},
              {"address", d.config.address},
              {"options", kept_json(d.config.options.text)},
              {"enabled", d.config.enabled},
              {"state", d.state},
              {"reason", text_or_null(d.reason)},
              {"conflict", text_or_null(d.conflict)},
              {"in_state_s", d.in_state_s},
              {"last_seen_us", d.last_seen ? Ordered(d.last_seen->us()) : Ordered(nullptr)},
              {"network_id", network_id(d)},
              {"model", text_or_null(d.model)},
              {"firmware", text_or_null(d.firmware)},
              {"serial", text_or_null(d.serial)},
              {"rate_hz", d.rows_per_s},
              {"counters",
               {{"bytes_in", d.bytes_in},
                {"bytes_out", d.bytes_out},
                {"frames", d.frames},
                {"fixes", d.fixes},
                {"ranges", d.ranges},
                {"opened", d.opened},
                {"lost", d.lost}}}};
  Ordered dropped = Ordered::object();
  for (const auto& [reason, n] : d.dropped) dropped[reason] = n;
  out["dropped"] = std::move(dropped);
  if (d.rover) {
    out["rover"] = {{"t_us", d.rover->time.us()},
                    {"fix", k_fix_words.word(d.rover->fix)},
                    {"satellites", or_null(d.rover->satellites)},
                    {"age_s", or_null(d.rover->age_s)},
                    {"sigma_h_m", or_null(d.rover->sigma_h_m)},
                    {"sigma_v_m", or_null(d.rover->sigma_v_m)}};
  }
  if (d.clock) {
    out["clock"] = {{"drift_ppm", d.clock->drift_ppm},
                    {"sigma_s", d.clock->sigma_s},
                    {"settled", d.clock->settled},
                    {"skewed", d.clock->skewed}};
  }
  if (d.base) {
    const Wgs84 at = wgs84_from_ecef({d.base->ecef_m[0], d.base->ecef_m[1], d.base->ecef_m[2]});
    out["base"] = {{"station", d.base->station},
                   {"lon", at.lon_deg},
                   {"lat", at.lat_deg},
                   {"h_m", at.height_m},
                   {"antenna_height_m", or_null(d.base->antenna_height_m)}};
  }
  return out;
}

Ordered device_row_json(const DeviceReport& d) {
  return {{"network_id", network_id(d)},
          {"kind", d.config.kind},
          {"state", d.state == "talking"                    ? "live"
                    : d.state == "lost" || d.state == "off" ? "lost"
                                                            : "late"},
          {"last_seen_us", d.last_seen ? Ordered(d.last_seen->us()) : Ordered(nullptr)},
          {"rate_hz", d.rows_per_s},
          {"id", to_string(d.config.id)},
          {"name", d.config.name},
          {"phase", d.state},
          {"reason", text_or_null(d.reason)},
          {"conflict", text_or_null(d.conflict)}};
}

Ordered discovered_json(const DiscoveredDevice& f) {
  return {{"address", f.address},
          {"kind", text_or_null(f.kind)},
          {"evidence", f.evidence},
          {"configured", f.configured}};
}

Ordered clock_json(const DeviceClock& c) {
  return {{"source", c.from_receiver ? "receiver" : "system_clock"},
          {"system_offset_s", or_null(c.system_offset_s)},
          {"sigma_s", c.sigma_s},
          {"skew", text_or_null(c.skew)}};
}

void patch_device(const Json& body, bool whole, DeviceConfig& device, std::vector<FieldError>& errors) {
  Fields fields(body, "", errors);
  if (!fields.is_object()) return;
  if (auto kind = fields.word("kind", k_kinds, whole)) device.kind = *std::move(kind);
  if (const auto name = fields.text("name", 200)) device.name = *name;
  if (const auto address = fields.text("address", 500, whole)) device.address = *address;
  if (const auto enabled = fields.boolean("enabled")) device.enabled = *enabled;
  if (const Json* options = fields.child("options")) {
    if (!options->is_object() || to_wire(*options).size() > 10'000) {
      fields.error("options", "wrong_type", "must be an object below 10 kB");
    } else {
      auto merged = Json::parse(device.options.text, nullptr, false);
      // A mapping is one thing: keys of the one before must not live on in it.
      if (options->contains("mapping")) merged.erase("mapping");
      merged.merge_patch(*options);
      check_secret(*options, merged, errors);
      device.options = {to_wire(merged)};
    }
  } else if (body.contains("options")) {
    device.options = {"{}"};
  }
  fields.finish();
  if (device.name.empty()) device.name = device.kind;
}

}  // namespace anchord::api
