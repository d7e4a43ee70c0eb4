#include "drivers/sim/scenario_file.hpp"

#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string>

namespace anchord::sim {
namespace {

using Json = nlohmann::json;

constexpr std::size_t k_most = 10'000;  ///< of anything a scenario lists

/// One object of the file: fields are taken, and what was not taken is refused. The first error is kept.
class Object {
 public:
  Object(const Json& json, std::string path, std::optional<Error>& error)
      : json_(json), path_(std::move(path)), error_(error) {
    if (!json_.is_object()) fail("", "must be an object");
  }
  Object(const Object&) = delete;
  Object& operator=(const Object&) = delete;
  ~Object() {
    if (!json_.is_object()) return;
    for (const auto& [key, value] : json_.items()) {
      if (!taken_.contains(key)) fail(key, "is not a known key");
    }
  }
  const Json* child(const char* key) {
    taken_.insert(key);
    if (!json_.is_object()) return nullptr;
    const auto found = json_.find(key);
    return found == json_.end() || found->is_null() ? nullptr : &*found;
  }
  std::string path(const char* key) const { return path_ + "/" + key; }
  std::optional<Error>& error() { return error_; }
  void fail(const std::string& key, const std::string& why) {
    if (!error_)
      error_ = make_error(Errc::invalid_argument, path_ + (key.empty() ? "" : "/" + key) + " " + why);
  }
  std::optional<double> number(const char* key) {
    const Json* value = child(key);
    if (value == nullptr) return std::nullopt;
    if (!value->is_number() || !std::isfinite(value->get<double>())) {
      fail(key, "must be a number");
      return std::nullopt;
    }
    return value->get<double>();
  }
  void number(const char* key, double& into) {
    if (const auto value = number(key)) into = *value;
  }
  template <class Whole>
  void whole(const char* key, Whole& into, std::uint64_t most) {
    const auto value = number(key);
    if (!value) return;
    if (*value < 0 || *value > static_cast<double>(most) || *value != std::floor(*value))
      return fail(key, "must be a whole number up to " + std::to_string(most));
    into = static_cast<Whole>(*value);
  }
  void text(const char* key, std::string& into) {
    const Json* value = child(key);
    if (value == nullptr) return;
    if (!value->is_string()) return fail(key, "must be text");
    into = value->get<std::string>();
  }
  void flag(const char* key, bool& into) {
    const Json* value = child(key);
    if (value == nullptr) return;
    if (!value->is_boolean()) return fail(key, "must be true or false");
    into = value->get<bool>();
  }
  template <int N>
  void vector(const char* key, Eigen::Matrix<double, N, 1>& into) {
    const Json* value = child(key);
    if (value != nullptr && !read(*value, into)) fail(key, "must be " + std::to_string(N) + " numbers");
  }
  template <int N>
  static bool read(const Json& json, Eigen::Matrix<double, N, 1>& into) {
    if (!json.is_array() || json.size() != N) return false;
    for (int i = 0; i < N; ++i) {
      const Json& one = json[static_cast<std::size_t>(i)];
      if (!one.is_number() || !(std::abs(one.get<double>()) < 1e6)) return false;
      into[i] = one.get<double>();
    }
    return true;
  }
  template <class T, std::size_t N>
  void word(const char* key, const EnumTable<T, N>& table, T& into) {
    std::string said;
    text(key, said);
    if (said.empty()) return;
    if (const auto value = table.find(said))
      into = *value;
    else
      fail(key, "must be one of " + list_of(table.words()));
  }
  void id(const char* key, NetworkId& into) {
    std::string said;
    text(key, said);
    if (said.empty()) return;
    const auto parsed = parse_network_id(said);
    if (!parsed) return fail(key, parsed.error().message);
    into = parsed.value();
  }
  /// Each member of a list, as an object.
  template <class Take>
  bool each(const char* key, Take take) {
    const Json* list = child(key);
    if (list == nullptr) return false;
    if (!list->is_array() || list->size() > k_most) {
      fail(key, "must be a list of at most " + std::to_string(k_most));
      return false;
    }
    for (std::size_t i = 0; i < list->size(); ++i) {
      Object one((*list)[i], path(key) + "/" + std::to_string(i), error_);
      take(one);
    }
    return true;
  }

 private:
  const Json& json_;
  std::string path_;
  std::optional<Error>& error_;
  std::set<std::string, std::less<>> taken_;
};

void take_material(Object& of, Material& material) {
  std::string name;
  of.text("material", name);
  bool known = name.empty();
  for (const Material& one : {k_glass, k_brick, k_concrete, k_plasterboard, k_metal}) {
    if (one.name != name) continue;
    material = one;
    known = true;
  }
  // A material of the file's own: its name tells what it is for people, its numbers what it does.
  if (!known) material = Material{"other", 1, 0};
  const auto permittivity = of.number("relative_permittivity"), loss = of.number("loss_db");
  if (!known && !loss)
    of.fail("material", "is none of glass, brick, concrete, plasterboard, metal: give its loss_db");
  if (permittivity) material.relative_permittivity = *permittivity;
  if (loss) material.loss_db = *loss;
  if (material.relative_permittivity < 1 || material.loss_db < 0) of.fail("material", "is not possible");
}

void take_world(Object& of, World& world) {
  of.number("length_m", world.length_m);
  of.number("width_m", world.width_m);
  of.number("height_m", world.height_m);
  if (const Json* origin = of.child("origin")) {
    Object at(*origin, of.path("origin"), of.error());
    at.number("lat_deg", world.origin.lat_deg);
    at.number("lon_deg", world.origin.lon_deg);
    at.number("height_m", world.origin.height_m);
    if (std::abs(world.origin.lat_deg) > 89 || std::abs(world.origin.lon_deg) > 180)
      at.fail("", "is not on the globe");
  }
  std::vector<Panel> panels;
  if (of.each("walls", [&](Object& wall) {
        Eigen::Vector2d from(0, 0), to(0, 0);
        double bottom_m = 0, top_m = world.height_m, thickness_m = 0.2;
        Material material = k_brick;
        wall.vector<2>("from_m", from);
        wall.vector<2>("to_m", to);
        wall.number("bottom_m", bottom_m);
        wall.number("top_m", top_m);
        wall.number("thickness_m", thickness_m);
        take_material(wall, material);
        Panel panel = upright_wall(from, to, bottom_m, top_m, thickness_m, material);
        panel.excess_m = wall.number("excess_m");
        if ((to - from).norm() < 0.01 || top_m <= bottom_m) wall.fail("", "has no area");
        panels.push_back(panel);
      }))
    world.panels = std::move(panels);
  std::vector<Slab> slabs;
  if (of.each("floors", [&](Object& floor) {
        Slab slab;
        slab.material = k_concrete;
        slab.thickness_m = 0.25;
        floor.number("height_m", slab.height_m);
        floor.number("thickness_m", slab.thickness_m);
        take_material(floor, slab.material);
        const Json* outline = floor.child("outline_m");
        if (outline == nullptr || !outline->is_array() || outline->size() < 3 || outline->size() > 1000)
          return floor.fail("outline_m", "must be at least three corners");
        for (const Json& corner : *outline) {
          Eigen::Vector2d at;
          if (!Object::read<2>(corner, at)) return floor.fail("outline_m", "must be pairs of numbers");
          slab.outline_m.push_back(at);
        }
        slabs.push_back(std::move(slab));
      }))
    world.slabs = std::move(slabs);
  std::vector<WorldAnchor> anchors;
  if (of.each("anchors", [&](Object& one) {
        WorldAnchor anchor;
        one.id("id", anchor.id);
        one.vector<3>("enu_m", anchor.enu_m);
        if (const auto ppm = one.number("clock_drift_ppm")) anchor.clock_drift_ppm = *ppm;
        anchors.push_back(anchor);
      }))
    world.anchors = std::move(anchors);
}

void take_radio(Object& of, RadioOptions& radio) {
  of.number("transmit_dbm", radio.transmit_dbm);
  of.number("carrier_hz", radio.carrier_hz);
  of.number("range_sigma_m", radio.range_sigma_m);
  of.number("shared_bias_m", radio.shared_bias_m);
  of.number("anchor_bias_sigma_m", radio.anchor_bias_sigma_m);
  of.number("rss_sigma_db", radio.rss_sigma_db);
  of.number("sensitivity_dbm", radio.sensitivity_dbm);
  of.number("loss_chance", radio.loss_chance);
  of.number("zero_chance", radio.zero_chance);
  of.number("turn_lobe_db", radio.turn_lobe_db);
  of.flag("height_lobe", radio.height_lobe);
  of.number("level_bias_share", radio.level_bias_share);
  of.word("ranging", k_two_way_words, radio.two_way.scheme);
  of.number("reply_a_s", radio.two_way.reply_a_s);
  of.number("reply_b_s", radio.two_way.reply_b_s);
}

void take_impulse(Object& of, ImpulseOptions& impulse) {
  of.whole("taps", impulse.taps, 1016);
  of.number("decay_ns", impulse.decay_ns);
  of.number("floor_dbm", impulse.floor_dbm);
  of.number("diffuse_db", impulse.diffuse_db);
  of.number("tail_per_loss", impulse.tail_per_loss);
}

void take_path(Object& of, Scenario& scenario) {
  of.number("speed_mps", scenario.speed_mps);
  of.flag("loop", scenario.loop);
  std::vector<PathPoint> points;
  if (of.each("points", [&](Object& one) {
        PathPoint point;
        one.vector<3>("enu_m", point.enu_m);
        one.number("hold_s", point.hold_s);
        if (const auto heading = one.number("heading_deg"))
          point.heading_rad = *heading * std::numbers::pi / 180;
        one.flag("turn", point.turn);
        points.push_back(point);
      }))
    scenario.path = std::move(points);
  if (const Json* rings = of.child("rings")) {
    Object round(*rings, of.path("rings"), of.error());
    double clearance_m = 5;
    round.number("clearance_m", clearance_m);
    std::vector<double> heights_m;
    const Json* list = round.child("heights_m");
    for (const Json& height : list != nullptr ? *list : Json::array()) {
      if (!height.is_number()) return round.fail("heights_m", "must be numbers");
      heights_m.push_back(height.get<double>());
    }
    if (heights_m.empty()) return round.fail("heights_m", "must be a list of heights");
    scenario.path =
        ring_path({0, 0}, {scenario.world.length_m, scenario.world.width_m}, clearance_m, heights_m);
  }
}

void take_tag(Object& of, TagSetup& tag) {
  of.text("name", tag.name);
  of.id("id", tag.id);
  of.vector<3>("lever_arm_m", tag.lever_arm_m);
  of.whole("firmware", tag.firmware, 255);
  of.whole("plen", tag.plen, 255);
  of.whole("rates", tag.rates, 255);
  of.number("clock_drift_ppm", tag.clock_drift_ppm);
  of.number("reply_s", tag.reply_s);
  if (const auto range_s = of.number("range_s")) tag.range_s = *range_s;
  of.text("link", tag.link);
}

void take_rover(Object& of, RoverSetup& rover) {
  of.text("name", rover.name);
  of.word("format", k_rover_format_words, rover.format);
  of.word("port", k_rover_port_words, rover.port);
  of.whole("tcp_port", rover.tcp_port, 65'535);
  of.number("rate_hz", rover.rate_hz);
  of.number("delay_s", rover.delay_s);
  of.vector<3>("sigma_m", rover.sigma_m);
  of.vector<3>("float_sigma_m", rover.float_sigma_m);
  of.vector<3>("base_error_m", rover.base_error_m);
  of.text("link", rover.link);
}

void take_fault(Object& of, Fault& fault) {
  of.text("device", fault.device);
  of.word("kind", k_fault_words, fault.kind);
  of.number("from_s", fault.from_s);
  of.number("until_s", fault.until_s);
}

}  // namespace

Result<Scenario> parse_scenario(std::string_view text) {
  const Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (json.is_discarded()) return make_error(Errc::bad_frame, "the scenario is not JSON");
  Scenario scenario = demonstration_scenario();
  std::optional<Error> error;
  {
    Object of(json, "", error);
    std::string schema, start;
    of.text("schema", schema);
    if (schema != "anchord.scenario/1") of.fail("schema", "must be anchord.scenario/1");
    of.text("name", scenario.name);
    of.whole("seed", scenario.seed, std::uint64_t{1} << 53);
    of.text("start", start);
    if (!start.empty()) {
      const auto at = parse_rfc3339(start);
      if (at) scenario.start = at.value();
      if (!at) of.fail("start", at.error().message);
    }
    const auto part = [&](const char* key, auto take, auto& into) {
      if (const Json* child = of.child(key)) {
        Object one(*child, of.path(key), error);
        take(one, into);
      }
    };
    part("world", take_world, scenario.world);
    part("radio", take_radio, scenario.radio);
    part("impulse", take_impulse, scenario.impulse);
    part("path", take_path, scenario);
    std::vector<TagSetup> tags;
    if (of.each("tags", [&](Object& one) { take_tag(one, tags.emplace_back()); }))
      scenario.tags = std::move(tags);
    std::vector<RoverSetup> rovers;
    if (of.each("rovers", [&](Object& one) { take_rover(one, rovers.emplace_back()); }))
      scenario.rovers = std::move(rovers);
    of.each("faults", [&](Object& one) { take_fault(one, scenario.faults.emplace_back()); });
  }
  if (error) return *error;
  BOOST_OUTCOME_TRYV(check(scenario));
  return scenario;
}

Result<Scenario> read_scenario(const std::filesystem::path& file) {
  if (file == "demonstration") return demonstration_scenario();
  std::ifstream in(file, std::ios::binary);
  if (!in)
    return make_error(Errc::not_found, file.string() + ": cannot be read; \"demonstration\" is built in");
  const std::string text(std::istreambuf_iterator<char>(in), {});
  auto scenario = parse_scenario(text);
  if (!scenario) return make_error(scenario.error().code, file.string() + ": " + scenario.error().message);
  return scenario;
}

}  // namespace anchord::sim
