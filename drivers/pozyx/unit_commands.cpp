// What the operator asks of a tag, and the settings of a unit: both are JSON objects.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "drivers/pozyx/registers.hpp"
#include "drivers/pozyx/unit.hpp"

namespace anchord::pozyx {
namespace {

using Json = nlohmann::json;

Error bad_option(std::string_view option, std::string_view why) {
  return make_error(Errc::invalid_argument, std::string(option) + ": " + std::string(why));
}

Json object_of(std::string_view text) {
  if (text.empty()) return Json::object();
  return Json::parse(text.begin(), text.end(), nullptr, false);
}

Result<std::uint16_t> id_of(std::string_view option, const Json& value) {
  const auto id = value.is_string() ? parse_network_id(value.get_ref<const std::string&>())
                                    : Result<NetworkId>(bad_option(option, "must be text"));
  if (!id || id.value().value == 0 || id.value().value > 0xffff)
    return bad_option(option, "must be a network id like \"0x6a21\"");
  return static_cast<std::uint16_t>(id.value().value);
}

Result<double> number_of(std::string_view option, const Json& value, double min, double max) {
  if (!value.is_number() || !(value.get<double>() >= min) || !(value.get<double>() <= max))
    return bad_option(option, "must be a number");
  return value.get<double>();
}

Result<UwbSettings> uwb_of(const Json& value, UwbSettings settings) {
  if (!value.is_object()) return bad_option("uwb", "must be an object");
  for (const auto& [key, v] : value.items()) {
    if (key == "all" || key == "devices") continue;
    BOOST_OUTCOME_TRY(const double number, number_of(key, v, 0, 10'000));
    if (key == "channel") {
      settings.channel = static_cast<std::uint8_t>(std::min(number, 255.0));
    } else if (key == "rate_kbps") {
      if (number != 110 && number != 850 && number != 6810)
        return bad_option(key, "must be 110, 850 or 6810");
      settings.rate = static_cast<std::uint8_t>(number == 110 ? 0 : number == 850 ? 1 : 2);
    } else if (key == "prf_mhz") {
      if (number != 16 && number != 64) return bad_option(key, "must be 16 or 64");
      settings.prf = number == 16 ? Prf::mhz16 : Prf::mhz64;
    } else if (key == "preamble_symbols") {
      settings.preamble_symbols = static_cast<int>(number);
    } else if (key == "gain_db") {
      settings.gain_db = number;
    } else {
      return bad_option(key,
                        "no such setting: uwb has channel, rate_kbps, prf_mhz, preamble_symbols, gain_db");
    }
  }
  BOOST_OUTCOME_TRY(uwb_registers(settings));
  return settings;
}

Json to_json(const UwbSettings& s) {
  Json out{{"channel", s.channel},
           {"rate_kbps", s.rate == 0   ? 110
                         : s.rate == 1 ? 850
                                       : 6810},
           {"prf_mhz", s.prf == Prf::mhz16 ? 16 : 64},
           {"preamble_symbols", s.preamble_symbols}};
  if (s.gain_db) out["gain_db"] = *s.gain_db;
  return out;
}

Json to_json(const Applied& applied) {
  Json devices = Json::array();
  for (const DeviceOutcome& device : applied.devices) {
    Json one{{"network_id", to_string(NetworkId{device.id})}, {"done", device.done}};
    if (!device.why.empty()) one["why"] = device.why;
    devices.push_back(one);
  }
  return {{"all", applied.all}, {"rolled_back", applied.rolled_back}, {"devices", devices}};
}

// Apart from the scripts: g++ 12 mishandles initializer lists inside of them.
std::string devices_text(const std::vector<std::uint16_t>& ids) {
  Json list = Json::array();
  for (const std::uint16_t id : ids) list.push_back(to_string(NetworkId{id}));
  return to_wire(Json{{"devices", list}});
}

/// How the settings of another device stand to the tag's own.
Json compared(std::uint16_t id, const UwbSettings& own, const Result<UwbSettings>& theirs) {
  Json out{{"network_id", to_string(NetworkId{id})}, {"done", false}};
  if (!theirs) {
    out["why"] = theirs.error().message;
    return out;
  }
  const UwbSettings& s = theirs.value();
  const bool same = same_air(own, s);
  out["done"] = same;
  if (!same) {
    out["why"] = "has " + pozyx::to_string(s);
    if (s.gain_db) out["why"] = out["why"].get<std::string>() + ", gain " + to_wire(Json(*s.gain_db)) + " dB";
  }
  return out;
}

std::string range_text(const RangeInfo& info) {
  return to_wire(Json{{"distance_m", info.distance_mm * 1e-3}, {"rss_dbm", info.rss_dbm}});
}

std::string identity_text(const TagIdentity& tag, const UwbSettings& uwb) {
  return to_wire(Json{{"network_id", to_string(NetworkId{tag.id})},
                      {"model", tag.model()},
                      {"firmware", tag.firmware_text()},
                      {"selftest", tag.selftest},
                      {"selftest_passed", (tag.selftest & 0x30) == 0x30},
                      {"uwb", to_json(uwb)},
                      {"lights", "blinked"}});
}

std::string light_text(std::uint16_t id) {
  return to_wire(Json{{"network_id", to_string(NetworkId{id})}, {"lights", "blinked"}});
}

Result<std::vector<std::uint16_t>> ids_of(std::string_view option, const Json& value) {
  if (!value.is_array() || value.size() > 1000) return bad_option(option, "must be a list of network ids");
  std::vector<std::uint16_t> out;
  for (const Json& one : value) {
    BOOST_OUTCOME_TRY(const std::uint16_t id, id_of(option, one));
    out.push_back(id);
  }
  return out;
}

Result<UnitOptions> unit_options(const Json& json) {
  UnitOptions out;
  for (const auto& [key, value] : json.items()) {
    if (key == "anchors") {
      BOOST_OUTCOME_TRY(out.anchors, ids_of(key, value));
    } else if (key == "cir") {
      if (value != "none" && value != "window" && value != "whole")
        return bad_option(key, "must be none, window or whole");
      out.cir = value == "none" ? CirRead::none : value == "window" ? CirRead::window : CirRead::whole;
    } else if (key == "uwb") {
      BOOST_OUTCOME_TRY(const UwbSettings settings, uwb_of(value, {}));
      out.uwb = settings;
    } else if (key == "heading") {
      if (!value.is_boolean()) return bad_option(key, "must be true or false");
      out.heading = value.get<bool>();
    } else if (key == "anchor_anchor_s") {
      BOOST_OUTCOME_TRY(out.anchor_anchor_s, number_of(key, value, 0, 86'400));
    } else {
      return bad_option(key,
                        "no such option: a pozyx device has anchors, cir, uwb, heading, anchor_anchor_s");
    }
  }
  return out;
}

struct Push {
  std::vector<DeviceInfo> devices;
  bool save{};
};
Result<Push> push_of(const Json& json) {
  Push out;
  if (!json.is_object() || !json.contains("positions") || !json["positions"].is_array())
    return bad_option("positions", "must be a list of {network_id, x_m, y_m, z_m}");
  out.save = json.value("save", Json(false)) == Json(true);
  for (const Json& one : json["positions"]) {
    if (!one.is_object() || !one.contains("network_id"))
      return bad_option("positions", "each item needs its network_id");
    BOOST_OUTCOME_TRY(const std::uint16_t id, id_of("network_id", one["network_id"]));
    DeviceInfo device{id, true, {}};
    int axis = 0;
    for (const char* key : {"x_m", "y_m", "z_m"}) {
      if (!one.contains(key)) return bad_option(key, "is required");
      BOOST_OUTCOME_TRY(device.local_m[axis++], number_of(key, one[key], -2e6, 2e6));
    }
    out.devices.push_back(device);
  }
  return out;
}

}  // namespace

Result<std::unique_ptr<device::Driver>> make_unit(std::string_view options_json,
                                                  device::DriverOutput& output) {
  const Json json = object_of(options_json);
  if (!json.is_object()) return bad_option("options", "must be a JSON object");
  BOOST_OUTCOME_TRY(UnitOptions options, unit_options(json));
  return std::unique_ptr<device::Driver>(std::make_unique<Unit>(std::move(options), output));
}

Script<int> Unit::execute(device::Command command) {
  running_ = command.id;
  Result<std::string> answer = co_await outcome(command);
  running_.reset();
  out_.answer(command.id, answer);
  co_return 0;
}

Script<Result<std::string>> Unit::outcome(device::Command command) {
  Result<std::string> out =
      make_error(Errc::unsupported,
                 "a pozyx device knows identify, discover, get_uwb, set_uwb, push_positions, range_between, "
                 "reboot; not \"" +
                     command.name + "\"");
  if (command.name == "identify") {
    out = co_await identify(command.arguments_json);
  } else if (command.name == "discover") {
    out = co_await discover();
  } else if (command.name == "get_uwb") {
    out = co_await get_uwb(command.arguments_json);
  } else if (command.name == "set_uwb") {
    out = co_await set_uwb(command.arguments_json);
  } else if (command.name == "push_positions") {
    out = co_await push_positions(command.arguments_json);
  } else if (command.name == "range_between") {
    out = co_await range_between(command.arguments_json);
  } else if (command.name == "reboot") {
    rebooting_ = true;
    Result<void> done = co_await session_->tag.reset();
    if (done) done = co_await prepare();
    rebooting_ = false;
    if (!done) co_return done.error();
    out = std::string("{}");
  }
  co_return out;
}

Script<Result<std::string>> Unit::identify(std::string arguments) {
  const Json json = object_of(arguments);
  std::optional<std::uint16_t> other;
  if (json.is_object() && json.contains("network_id")) {
    const Result<std::uint16_t> id = id_of("network_id", json["network_id"]);
    if (!id) co_return id.error();
    if (id.value() != identity_.id) other = id.value();
  }
  const Result<TagIdentity> read = co_await session_->tag.identify();
  if (!read) co_return read.error();
  const Result<void> blinked = co_await session_->tag.blink(other);
  if (!blinked) co_return blinked.error();
  out_.heard();  // it ranged to nobody meanwhile
  if (other) co_return light_text(*other);
  co_return identity_text(read.value(), session_->tag.settings());
}

Script<Result<std::string>> Unit::discover() {
  std::vector<std::uint16_t> seen;
  for (int i = 0; i < 3; ++i) {  // random slots: absence in one run is not absence
    const Result<std::vector<std::uint16_t>> found = co_await session_->tag.discover(2, false);
    if (!found) co_return found.error();
    seen = found.value();
  }
  if (options_.anchors.empty()) co_await adopt(seen);
  co_return devices_text(seen);
}

Script<Result<std::string>> Unit::get_uwb(std::string arguments) {
  const Json json = object_of(arguments);
  const bool others = json.is_object() && json.value("devices", Json(false)) == Json(true);
  const Result<UwbSettings> own = co_await session_->tag.uwb();
  if (!own) co_return own.error();
  Json out = to_json(own.value());
  if (others) {
    // Three tries of a second each for one that is silent: the answer must come while somebody waits for it.
    constexpr std::int64_t k_patience_ns = 15'000'000'000;
    const std::int64_t until_ns = session_->wire.now_ns() + k_patience_ns;
    std::vector<std::uint16_t> ids;
    for (const auto& [id, anchor] : anchors_) ids.push_back(id);
    out["devices"] = Json::array();
    for (const std::uint16_t id : ids) {
      Result<Bytes> registers = make_error(Errc::link_lost, "not asked: the other devices took too long");
      if (session_->wire.now_ns() < until_ns)
        registers = co_await session_->tag.remote_read(id, reg::uwb_channel, 4);
      out_.heard();  // it ranged to nobody meanwhile
      Result<UwbSettings> theirs = registers ? uwb_settings(registers.value()) : registers.error();
      out["devices"].push_back(compared(id, own.value(), theirs));
    }
  }
  co_return to_wire(out);
}

Script<Result<std::string>> Unit::set_uwb(std::string arguments) {
  const Json json = object_of(arguments);
  const Result<UwbSettings> wanted = uwb_of(json, session_->tag.settings());
  if (!wanted) co_return wanted.error();
  if (json.value("all", Json(true)) != Json(true)) {
    const Result<UwbSettings> set = co_await session_->tag.set_uwb(wanted.value());
    if (!set) co_return set.error();
    co_return to_wire(to_json(set.value()));
  }
  std::vector<std::uint16_t> others;
  if (json.contains("devices")) {
    const Result<std::vector<std::uint16_t>> named = ids_of("devices", json["devices"]);
    if (!named) co_return named.error();
    others = named.value();
  } else {
    for (const auto& [id, anchor] : anchors_) others.push_back(id);
  }
  const Result<Applied> applied = co_await session_->tag.set_uwb_everywhere(wanted.value(), others);
  if (!applied) co_return applied.error();
  co_return to_wire(to_json(applied.value()));
}

Script<Result<std::string>> Unit::push_positions(std::string arguments) {
  const Result<Push> push = push_of(object_of(arguments));
  if (!push) co_return push.error();
  const Result<Applied> applied =
      co_await session_->tag.push_positions(push.value().devices, push.value().save);
  if (!applied) co_return applied.error();
  co_return to_wire(to_json(applied.value()));
}

Script<Result<std::string>> Unit::range_between(std::string arguments) {
  const Json json = object_of(arguments);
  if (!json.is_object() || !json.contains("from") || !json.contains("to"))
    co_return bad_option("from, to", "both are required");
  const Result<std::uint16_t> from = id_of("from", json["from"]), to = id_of("to", json["to"]);
  if (!from) co_return from.error();
  if (!to) co_return to.error();
  const Ranging ranging = co_await session_->tag.range_between(from.value(), to.value());
  if (!count(ranging)) {
    const std::string why =
        ranging.failure.empty() ? std::string(pozyx::to_string(ranging.fault)) : ranging.failure;
    co_return make_error(Errc::not_found, "no range: " + why);
  }
  emit_between(ranging, from.value(), to.value());
  co_return range_text(ranging.info);
}

}  // namespace anchord::pozyx
