#include "api/formats/flight_json.hpp"

#include <cmath>
#include <fstream>
#include <initializer_list>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "core/base/whole_file.hpp"

namespace anchord {
namespace {

using Json = nlohmann::json;

/// Reads one JSON object by known keys; collects the first error.
class Reader {
 public:
  Reader(const Json& json, std::string where, std::optional<Error>& error)
      : json_(json), where_(std::move(where)), error_(error) {
    if (!json_.is_object()) fail("is not an object");
  }

  void allow(std::initializer_list<std::string_view> keys) {
    if (!json_.is_object()) return;
    for (const auto& [key, value] : json_.items()) {
      bool known = false;
      for (const auto k : keys) known = known || k == key;
      if (!known) fail("unknown key '" + key + "'");
    }
  }
  const Json* find(const char* key) const {
    if (!json_.is_object()) return nullptr;
    const auto at = json_.find(key);
    return at == json_.end() ? nullptr : &*at;
  }
  std::string text(const char* key, bool required) {
    const Json* value = find(key);
    if (value && value->is_string()) return value->get<std::string>();
    if (value && value->is_number_integer()) return std::to_string(value->get<long long>());
    if (value) fail("'" + std::string(key) + "' is not a string");
    if (!value && required) fail("key '" + std::string(key) + "' is missing");
    return {};
  }
  double number(const char* key, double otherwise) {
    const Json* value = find(key);
    if (!value) return otherwise;
    if (value->is_number() && std::isfinite(value->get<double>())) return value->get<double>();
    fail("'" + std::string(key) + "' is not a number");
    return otherwise;
  }
  void fail(const std::string& what) {
    if (!error_) error_ = make_error(Errc::invalid_argument, where_ + ": " + what);
  }
  const std::string& where() const { return where_; }

 private:
  const Json& json_;
  std::string where_;
  std::optional<Error>& error_;
};

/// Coordinates of another system, in x_m, y_m, z_m.
void read_source(Reader& r, FlightDeclaration& flight) {
  flight.mission.frame = TrackFrame::local;
  SourceCrsSpec spec;
  spec.crs = r.text("crs", true);
  spec.max_datum_error_m = r.number("max_datum_error_m", spec.max_datum_error_m);
  if (const auto heights = r.text("heights", false); !heights.empty()) {
    if (const auto read = read_heights(heights, spec); !read) r.fail(read.error().message);
  }
  flight.source = spec;
}

void read_track(Reader r, FlightDeclaration& flight, const std::string& file, std::optional<Error>& error) {
  r.allow({"frame", "crs", "heights", "max_datum_error_m", "point", "in", "attitude", "heading_column",
           "heading_enu_ccw_from_east_deg"});
  const std::string frame = r.text("frame", true);
  if (const auto known = k_frame_words.find(frame)) {
    flight.mission.frame = *known;
  } else if (frame == "crs") {
    read_source(r, flight);
  } else {
    r.fail("'frame' is '" + frame + "', expected one of " + list_of(k_frame_words.words()) + ", crs");
  }
  if (!flight.source && (r.find("crs") || r.find("heights") || r.find("max_datum_error_m")))
    r.fail("'crs', 'heights' and 'max_datum_error_m' are only for the frame crs");
  const std::string point = r.text("point", true);
  if (const auto known = k_point_words.find(point)) {
    flight.mission.point = *known;
  } else {
    r.fail("'point' is '" + point + "', expected one of " + list_of(k_point_words.words()));
  }
  const std::string in = r.text("in", false);
  if (!in.empty() && in != "ranges" && in != "track")
    r.fail("'in' is '" + in + "', expected ranges or track");
  flight.track_in_ranges = in == "ranges";
  const std::string attitude = r.text("attitude", false);
  if (!attitude.empty() && attitude != "quaternion_xyzw" && attitude != "none") {
    r.fail("'attitude' is '" + attitude + "', expected quaternion_xyzw or none");
  }
  flight.quaternion = attitude == "quaternion_xyzw";
  flight.heading_column = r.text("heading_column", false);
  if (const Json* heading = r.find("heading_enu_ccw_from_east_deg")) {
    Reader h(*heading, file + ": track.heading_enu_ccw_from_east_deg", error);
    h.allow({"add"});
    flight.heading_add_deg = h.number("add", 0.0);
    if (flight.heading_column.empty()) r.fail("a heading offset without 'heading_column'");
  }
}

void read_tag(Reader r, Mission& mission) {
  r.allow({"tag_id", "antenna", "lever_arm_body_m"});
  TagAntenna antenna;
  const std::string id = r.text("tag_id", true);
  antenna.tag = network_id_of(id);
  const std::string number = r.text("antenna", false);
  if (!number.empty()) {
    const auto parsed =
        number.size() <= 3 ? parse_network_id(number) : Result<NetworkId>(make_error(Errc::bad_frame, ""));
    if (!parsed || parsed.value().value > 255) {
      r.fail("'antenna' is '" + number + "', expected 0 to 255");
      return;
    }
    antenna.antenna = static_cast<std::uint8_t>(parsed.value().value);
  }
  if (const Json* arm = r.find("lever_arm_body_m")) {
    if (!arm->is_array() || arm->size() != 3) {
      r.fail("'lever_arm_body_m' is not three numbers");
      return;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const Json& value = (*arm)[i];
      if (!value.is_number() || !std::isfinite(value.get<double>()) ||
          std::abs(value.get<double>()) > 100.0) {
        r.fail("'lever_arm_body_m' is not three numbers of metres");
        return;
      }
      antenna.lever_arm_body_m[static_cast<Eigen::Index>(i)] = value.get<double>();
    }
  }
  for (const auto& other : mission.tags) {
    if (other.tag == antenna.tag && other.antenna == antenna.antenna) r.fail("tag '" + id + "' occurs twice");
  }
  mission.tags.push_back(antenna);
}

}  // namespace

NetworkId network_id_of(std::string_view text) {
  if (const auto id = parse_network_id(text)) return id.value();
  std::uint32_t hash = 2166136261U;  // FNV-1a, 32 bit
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
  return {hash | 0x80000000U};
}

Result<FlightDeclaration> read_flight_json(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    std::error_code ignored;
    return make_error(
        Errc::not_found,
        file.string() + (std::filesystem::exists(file, ignored)
                             ? ": cannot be opened"
                             : ": does not exist. A flight folder has flight.json, ranges.csv and track.csv "
                               "(docs/formats.md); for tables of other programs use --track and --ranges, or "
                               "Import a flight in the dashboard"));
  }
  constexpr std::size_t k_max_bytes = 1 << 20;
  std::string text(k_max_bytes + 1, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  if (text.size() > k_max_bytes) return make_error(Errc::invalid_argument, file.string() + ": over 1 MiB");
  Json json;
  try {
    // Depth is bounded before the parser may recurse: a declaration is four levels deep.
    const auto depth_ok = [](int depth, Json::parse_event_t, Json&) {
      if (depth > 8) throw std::length_error("nested deeper than 8");
      return true;
    };
    json = Json::parse(text, depth_ok);
  } catch (const std::exception& e) {
    return make_error(Errc::invalid_argument, file.string() + ": " + e.what());
  }
  FlightDeclaration flight;
  std::optional<Error> error;
  Reader r(json, file.string(), error);
  r.allow({"name", "kit", "radio", "site", "epoch_utc", "track", "tags", "lever_arm_sigma_m"});
  flight.mission.name = r.text("name", false);
  flight.mission.kit = r.text("kit", false);
  flight.mission.radio = r.text("radio", false);
  if (flight.mission.name.empty()) {
    flight.mission.name =
        std::filesystem::absolute(file).lexically_normal().parent_path().filename().string();
  }
  if (const std::string epoch = r.text("epoch_utc", false); !epoch.empty()) {
    if (const auto time = parse_rfc3339(epoch)) {
      flight.epoch = time.value();
    } else {
      r.fail("'epoch_utc': " + time.error().message);
    }
  }
  if (const Json* track = r.find("track")) {
    read_track(Reader(*track, file.string() + ": track", error), flight, file.string(), error);
  } else {
    r.fail("key 'track' is missing");
  }
  if (const Json* tags = r.find("tags")) {
    if (!tags->is_array()) r.fail("'tags' is not a list");
    for (std::size_t i = 0; tags->is_array() && i < tags->size(); ++i) {
      read_tag(Reader((*tags)[i], file.string() + ": tags[" + std::to_string(i) + "]", error),
               flight.mission);
    }
  }
  if (const Json* sigma = r.find("lever_arm_sigma_m"); sigma && !sigma->is_null()) {
    if (sigma->is_number() && is_lever_arm_sigma(sigma->get<double>()))
      flight.mission.lever_arm_sigma_m = sigma->get<double>();
    else
      r.fail(std::string("'lever_arm_sigma_m' ") + k_lever_arm_sigma_rule);
  }
  if (error) return *error;
  flight.mission.created = flight.epoch;
  flight.mission.state = MissionState::finished;
  return flight;
}

Result<void> write_flight_json(const FlightDeclaration& flight, const std::filesystem::path& file) {
  const Mission& mission = flight.mission;
  Json json;
  if (!mission.name.empty()) json["name"] = mission.name;
  if (!mission.kit.empty()) json["kit"] = mission.kit;
  if (!mission.radio.empty()) json["radio"] = mission.radio;
  json["epoch_utc"] = to_rfc3339(flight.epoch);
  json["track"]["frame"] = k_frame_words.word(mission.frame);
  json["track"]["point"] = k_point_words.word(mission.point);
  if (flight.quaternion) json["track"]["attitude"] = "quaternion_xyzw";
  json["tags"] = Json::array();
  for (const auto& tag : mission.tags) {
    const auto& arm = tag.lever_arm_body_m;
    json["tags"].push_back({{"tag_id", to_string(tag.tag)},
                            {"antenna", std::to_string(tag.antenna)},
                            {"lever_arm_body_m", {arm.x(), arm.y(), arm.z()}}});
  }
  if (mission.lever_arm_sigma_m) json["lever_arm_sigma_m"] = *mission.lever_arm_sigma_m;
  return write_whole(file, to_wire(json, 1) + '\n');
}

}  // namespace anchord
