#include "api/flight/procedure_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "api/kit/or_null.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;
using procedure::Step;

double degrees(double rad) {
  const double deg = std::fmod(rad * 180 / std::numbers::pi, 360.0);
  return deg < 0 ? deg + 360 : deg;
}
Ordered finite_or_null(double value) { return std::isfinite(value) ? Ordered(value) : Ordered(nullptr); }
Ordered xyz(const Eigen::Vector3d& p) { return Ordered{p.x(), p.y(), p.z()}; }

/// A point of the plan, and where it is, as maps and tables want it. Heights above the plan's ground are the
/// local z: the earth's curve is below a centimetre within 300 m.
Ordered place(const Eigen::Vector3d& enu_m, const Wgs84& at) {
  return {
      {"lon", at.lon_deg}, {"lat", at.lat_deg}, {"height_above_ground_m", enu_m.z()}, {"enu_m", xyz(enu_m)}};
}

Ordered anchors_json(const ProcedureView& v) {
  Ordered out = Ordered::array();
  for (std::size_t i = 0; i < v.anchors.size(); ++i) {
    const auto& a = v.state.anchors[i];
    const auto& more = v.anchors[i];
    out.push_back({{"network_id", to_string(a.id)},
                   {"done", a.done},
                   {"reached", a.reached},
                   {"ended_by", a.ended_by.empty() ? Ordered(nullptr) : Ordered(a.ended_by)},
                   {"accepted", a.accepted},
                   {"target_sigma_m", or_null(more.target_sigma_m)},
                   {"why", a.why},
                   {"iterations", a.iterations},
                   {"waiting", a.waiting},
                   {"weight", procedure::weight_of(a)},
                   {"bearing_deg", more.bearing_rad ? Ordered(degrees(*more.bearing_rad)) : Ordered(nullptr)},
                   {"height_m", or_null(more.height_m)},
                   {"height_at_edge", or_null(more.height_at_edge)},
                   {"no_lobe", a.no_lobe}});
  }
  return out;
}

}  // namespace

Ordered drone_json(const DroneStatus& d) {
  // An aircraft of which nothing was received has been silent since the start of the server, which says
  // nothing of the aircraft.
  const bool heard = d.connected || d.identity.system != 0;
  Ordered others = Ordered::array();
  for (const auto& o : d.others) {
    others.push_back({{"sender", o.sender},
                      {"system", o.system},
                      {"component", o.component},
                      {"kind", o.kind},
                      {"frames", o.frames},
                      {"silent_s", o.silent_s}});
  }
  return {{"connected", d.connected},
          {"silent_s", heard ? finite_or_null(d.silent_s) : Ordered(nullptr)},
          {"autopilot", d.autopilot},
          {"mode", d.mode},
          {"armed", d.armed},
          {"in_air", d.in_air},
          {"failsafe", d.failsafe},
          {"taken_over", d.taken_over},
          {"lon", d.position ? Ordered(d.position->lon_deg) : Ordered(nullptr)},
          {"lat", d.position ? Ordered(d.position->lat_deg) : Ordered(nullptr)},
          {"above_home_m", or_null(d.relative_m)},
          {"heading_deg", or_null(d.heading_deg)},
          {"speed_mps", or_null(d.speed_mps)},
          {"battery", or_null(d.battery)},
          {"battery_v", or_null(d.battery_v)},
          {"battery_age_s", finite_or_null(d.battery_age_s)},
          {"position_age_s", finite_or_null(d.position_age_s)},
          {"stale", d.stale},
          {"streams_refused", d.streams_refused},
          {"ready_to_arm", or_null(d.ready_to_arm)},
          {"not_ready", d.not_ready},
          {"gps_fix", d.gps_fix},
          {"text", d.text},
          {"peer", d.identity.peer},
          {"link_signed", d.link_signed},
          {"frames_refused", d.frames_refused},
          {"others", std::move(others)},
          {"link_trouble", d.link_trouble}};
}

Ordered flight_command_json(const FlightCommand& c) {
  return {{"number", c.number}, {"action", c.action}, {"state", to_string(c.state)},
          {"text", c.text},     {"by", c.by},         {"t_us", c.at.us()}};
}

void read_engine(const procedure::FlightEngine& engine, const EnuFrame& frame, ProcedureView& view) {
  const auto& setup = engine.setup();
  view.state = engine.state();
  const auto& s = view.state;
  for (const auto& task : s.anchors) {
    auto& one = view.anchors.emplace_back();
    one.target_sigma_m = setup.exit_rule(task.id).target_sigma_m;
    const auto priors = engine.priors().find(task.id);
    if (priors == engine.priors().end()) continue;
    if (const auto& bearing = priors->second.bearing) one.bearing_rad = bearing->bearing_rad;
    if (const auto& height = priors->second.height) {
      one.height_m = height->height_m;
      one.height_at_edge = height->at_edge;
    }
  }
  const bool flying = s.step != Step::ready && s.step != Step::done;
  if (flying && s.n_transitions > 0) view.target = frame.wgs84_from_enu(Enu{s.target_m});
  if (flying) view.distance_m = engine.distance_left_m();
  view.target_sigma_m = setup.exit.target_sigma_m;
  if (const auto at = engine.position_m()) view.battery_needed = procedure::return_margin(setup.limits, *at);
  view.elapsed_s = engine.flown_s(view.now_s);
  view.n_waypoints = setup.settings.waypoints.size();
  view.k = setup.settings.k;
  view.alarm = engine.alarm();
}

Ordered procedure_json(const ProcedureView& v) {
  const auto& s = v.state;
  Ordered target(nullptr);
  if (v.target) {
    target = place(s.target_m, *v.target);
    target["heading_deg"] = s.heading_rad ? Ordered(degrees(*s.heading_rad)) : Ordered(nullptr);
  }
  Ordered commands = Ordered::array();
  for (const auto& c : v.commands) commands.push_back(flight_command_json(c));
  Ordered out{{"mission", to_string(v.mission)},
              {"t_us", v.t_us},
              {"plan", v.plan.empty() ? Ordered(nullptr) : Ordered(v.plan)},
              {"plan_name", v.name},
              {"plan_revision", v.plan_revision},
              {"plan_saved_revision", v.saved_revision > 0 ? Ordered(v.saved_revision) : Ordered(nullptr)},
              {"plan_undo_revision", or_null(v.undo_revision)},
              {"plan_changes", v.plan_changes},
              {"mode", v.mode},
              {"status", flight::k_flight_status_words.word(v.status)},
              {"step", procedure::to_string(s.step)},
              {"reason", s.reason},
              {"ended", v.ended.empty() ? Ordered(nullptr) : Ordered(v.ended)},
              {"in_step_s", std::max(0.0, v.now_s - s.since_s)},
              {"step_limit_s", s.deadline_s > 0 ? Ordered(s.deadline_s - s.since_s) : Ordered(nullptr)},
              {"target_sigma_m", or_null(v.target_sigma_m)},
              {"elapsed_s", finite_or_null(v.elapsed_s)},
              {"forecast_s", v.forecast ? Ordered{{"low", v.forecast->low_s},
                                                  {"expected", v.forecast->expected_s},
                                                  {"high", v.forecast->high_s}}
                                        : Ordered(nullptr)},
              {"waypoint", s.waypoint + 1},
              {"n_waypoints", v.n_waypoints},
              {"part", s.steps},
              {"k", v.k},
              {"iteration", s.visited.size()},
              {"target", std::move(target)},
              {"distance_m", or_null(v.distance_m)},
              {"anchors", anchors_json(v)}};
  out["battery_needed"] = or_null(v.battery_needed);
  out["alarm"] = v.alarm ? Ordered{{"id", v.alarm->id},
                                   {"reaction", procedure::to_string(v.alarm->reaction)},
                                   {"text", v.alarm->text}}
                         : Ordered(nullptr);
  out["shift_m"] = v.shift_m ? xyz(*v.shift_m) : Ordered(nullptr);
  out["drone"] = v.drone ? drone_json(*v.drone) : Ordered(nullptr);
  out["control"] =
      v.holder
          ? Ordered{{"holder", *v.holder}, {"since_us", v.holder_since_us}, {"expires_us", v.holder_until_us}}
          : Ordered(nullptr);
  out["commands"] = std::move(commands);
  return out;
}

Ordered grid_json(const GridView& v) {
  Ordered out{{"mission", to_string(v.mission)}, {"t_us", v.t_us}, {"iteration", v.visited.size()}};
  out["rule"] = planning::to_string(v.rule);
  out["combine"] = planning::to_string(v.combine);
  Ordered candidates = Ordered::array(), visited = Ordered::array(), unreachable = Ordered::array();
  for (const auto& p : v.visited) visited.push_back(xyz(p));
  for (const auto& p : v.unreachable) unreachable.push_back(xyz(p));
  const auto& record = v.decision;
  if (record) {
    for (const auto& c : record->decision.candidates) {
      Ordered one = place(c.point_m, v.frame.wgs84_from_enu(Enu{c.point_m}));
      one["value"] = finite_or_null(c.value);
      one["p_nlos"] = finite_or_null(c.p_nlos);
      one["flight_s"] = finite_or_null(c.flight_s);
      one["refused"] = c.refused ? Ordered(planning::to_string(*c.refused)) : Ordered(nullptr);
      candidates.push_back(std::move(one));
    }
  }
  out["chosen"] = record && record->decision.chosen ? Ordered(*record->decision.chosen) : Ordered(nullptr);
  out["value_before"] = record ? finite_or_null(record->decision.value_before) : Ordered(nullptr);
  out["predicted"] = record ? or_null(record->predicted) : Ordered(nullptr);
  out["reached"] = record ? or_null(record->reached) : Ordered(nullptr);
  out["reason"] = record ? record->decision.reason : "";
  out["outcome"] = record ? record->outcome : "";
  out["candidates"] = std::move(candidates);
  out["visited"] = std::move(visited);
  out["unreachable"] = std::move(unreachable);
  return out;
}

Ordered turn_json(const MissionId& mission, NetworkId anchor, std::int64_t t_us,
                  const procedure::Priors& priors, bool running) {
  Ordered samples = Ordered::array();
  for (const auto& s : priors.turn) samples.push_back({degrees(s.heading_rad), s.rss_dbm});
  const auto& b = priors.bearing;
  return {{"mission", to_string(mission)},
          {"anchor", to_string(anchor)},
          {"t_us", t_us},
          {"running", running},
          {"samples", std::move(samples)},
          {"bearing_deg", b ? Ordered(degrees(b->bearing_rad)) : Ordered(nullptr)},
          {"sigma_deg", b ? Ordered(b->sigma_rad * 180 / std::numbers::pi) : Ordered(nullptr)},
          {"confidence", b ? Ordered(b->confidence) : Ordered(nullptr)}};
}

Ordered height_json(const MissionId& mission, NetworkId anchor, std::int64_t t_us,
                    const procedure::Priors& priors, bool running) {
  Ordered samples = Ordered::array();
  for (const auto& s : priors.heights) samples.push_back({s.height_m, s.rss_dbm});
  const auto& h = priors.height;
  return {{"mission", to_string(mission)},
          {"anchor", to_string(anchor)},
          {"t_us", t_us},
          {"running", running},
          {"samples", std::move(samples)},
          {"height_m", h ? Ordered(h->height_m) : Ordered(nullptr)},
          {"sigma_m", h ? Ordered(h->sigma_m) : Ordered(nullptr)},
          {"at_edge", h ? Ordered(h->at_edge) : Ordered(nullptr)}};
}

Ordered stored_state(const procedure::State& s) {
  const auto points = [](const std::vector<Eigen::Vector3d>& all) {
    Ordered out = Ordered::array();
    for (const auto& p : all) out.push_back(xyz(p));
    return out;
  };
  Ordered anchors = Ordered::array();
  for (const auto& a : s.anchors) {
    anchors.push_back({{"id", to_string(a.id)},
                       {"bearing", a.has_bearing},
                       {"height", a.has_height},
                       {"no_lobe", a.no_lobe},
                       {"iterations", a.iterations},
                       {"waiting", a.waiting},
                       {"done", a.done},
                       {"reached", a.reached},
                       {"ended_by", a.ended_by},
                       {"accepted", a.accepted},
                       {"why", a.why}});
  }
  return {{"step", procedure::to_string(s.step)},
          {"interrupted", procedure::to_string(s.interrupted)},
          {"waypoint", s.waypoint},
          {"moves", s.moves},
          {"steps", s.steps},
          {"legs", s.legs},
          {"points", s.points},
          {"target_m", xyz(s.target_m)},
          {"former_m", xyz(s.former_m)},
          {"centre_m", xyz(s.centre_m)},
          {"heading_rad", or_null(s.heading_rad)},
          {"visited", points(s.visited)},
          {"unreachable", points(s.unreachable)},
          {"anchors", std::move(anchors)},
          {"ended", s.ended},
          {"completed", s.completed},
          {"by_person", s.by_person},
          {"flown_s", s.flown_s},
          {"n_transitions", s.n_transitions}};
}

std::optional<procedure::State> state_of(const nlohmann::json& j) {
  const auto vector = [](const nlohmann::json& v) {
    return Eigen::Vector3d(v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>());
  };
  try {
    procedure::State s;
    const auto step = procedure::k_step_words.find(j.at("step").get<std::string>());
    const auto interrupted = procedure::k_step_words.find(j.at("interrupted").get<std::string>());
    if (!step || !interrupted) return std::nullopt;
    s.step = *step;
    s.interrupted = *interrupted;
    j.at("waypoint").get_to(s.waypoint);
    j.at("moves").get_to(s.moves);
    j.at("steps").get_to(s.steps);
    j.at("legs").get_to(s.legs);
    j.at("points").get_to(s.points);
    s.target_m = vector(j.at("target_m"));
    s.former_m = vector(j.at("former_m"));
    s.centre_m = vector(j.at("centre_m"));
    if (!j.at("heading_rad").is_null()) s.heading_rad = j.at("heading_rad").get<double>();
    for (const auto& p : j.at("visited")) s.visited.push_back(vector(p));
    for (const auto& p : j.at("unreachable")) s.unreachable.push_back(vector(p));
    for (const auto& a : j.at("anchors")) {
      const auto id = parse_network_id(a.at("id").get<std::string>());
      if (!id) return std::nullopt;
      procedure::AnchorTask task;
      task.id = id.value();
      a.at("bearing").get_to(task.has_bearing);
      a.at("height").get_to(task.has_height);
      task.no_lobe = a.value("no_lobe", false);
      a.at("iterations").get_to(task.iterations);
      a.at("waiting").get_to(task.waiting);
      a.at("done").get_to(task.done);
      task.reached = a.value("reached", false);
      task.ended_by = a.value("ended_by", "");
      task.accepted = a.value("accepted", false);
      a.at("why").get_to(task.why);
      s.anchors.push_back(std::move(task));
    }
    s.ended = j.value("ended", "");
    s.completed = j.value("completed", false);
    s.by_person = j.value("by_person", false);
    s.flown_s = j.value("flown_s", 0.0);
    j.at("n_transitions").get_to(s.n_transitions);
    return s;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;  // written by another version: whoever asks says so
  }
}

nlohmann::ordered_json stored_priors(const procedure::FlightPriors& priors) {
  const auto at = [](const Wgs84& p) { return Ordered{p.lat_deg, p.lon_deg, p.height_m}; };
  Ordered out = Ordered::object();
  for (const auto& [anchor, prior] : priors) {
    Ordered one = Ordered::object();
    if (const auto& b = prior.bearing)
      one["bearing"] = {{"from", at(b->from)}, {"rad", b->bearing_rad}, {"sigma_rad", b->sigma_rad}};
    if (const auto& h = prior.height) one["height"] = {{"at", at(h->at)}, {"sigma_m", h->sigma_m}};
    out[to_string(anchor)] = std::move(one);
  }
  return out;
}

procedure::FlightPriors priors_of(const nlohmann::json& j) {
  const auto place = [](const nlohmann::json& v) {
    return Wgs84{v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>()};
  };
  procedure::FlightPriors out;
  if (!j.is_object()) return out;
  for (const auto& [text, one] : j.items()) {
    const auto anchor = parse_network_id(text);
    if (!anchor) continue;
    try {
      procedure::FlightPrior prior;
      if (one.contains("bearing")) {
        const auto& b = one.at("bearing");
        prior.bearing = {place(b.at("from")), b.at("rad").get<double>(), b.at("sigma_rad").get<double>()};
      }
      if (one.contains("height")) {
        const auto& h = one.at("height");
        prior.height = {place(h.at("at")), h.at("sigma_m").get<double>()};
      }
      out[anchor.value()] = prior;
    } catch (const nlohmann::json::exception&) {
      continue;
    }
  }
  return out;
}

procedure::FlightPriors priors_in_document(const nlohmann::json& j) {
  if (!j.is_object()) return {};
  return priors_of(j.value(j.contains("priors") ? "priors" : "clues", nlohmann::json()));
}

nlohmann::ordered_json flight_upload_json(const FlightUpload& upload) {
  return {{"what", upload.what},
          {"plan", to_string(upload.plan)},
          {"plan_revision", upload.revision},
          {"items", upload.n_items},
          {"command", flight_command_json(upload.command)}};
}

nlohmann::ordered_json checklist_json(const std::vector<ChecklistItem>& items) {
  auto list = nlohmann::ordered_json::array();
  bool ready = true;
  for (const auto& i : items) {
    ready = ready && i.green();
    const bool person = !i.ok;
    list.push_back(
        {{"id", i.id},
         {"text", i.text},
         {"state", i.green() ? "ok"
                   : person  ? "open"
                             : "failed"},
         {"manual", person},
         {"overridable", i.overridable},
         {"detail", i.detail},
         {"overridden_by", i.overridden_by.empty() ? nlohmann::ordered_json(nullptr)
                                                   : nlohmann::ordered_json(i.overridden_by)},
         {"override_reason", i.override_reason.empty() ? nlohmann::ordered_json(nullptr)
                                                       : nlohmann::ordered_json(i.override_reason)}});
  }
  return {{"ready", ready}, {"items", std::move(list)}};
}

}  // namespace anchord::api
