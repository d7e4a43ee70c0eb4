#include "api/formats/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"

namespace anchord {
namespace {

using Json = nlohmann::json;

constexpr std::size_t k_max_track = 400;
constexpr std::size_t k_max_residuals = 500;

Json rounded(double value, double steps) {
  if (!std::isfinite(value)) return nullptr;
  return std::round(value * steps) / steps;
}
double number(const Json& value) { return value.is_number() ? value.get<double>() : std::nan(""); }

Json valued(const Valued& v) { return {rounded(v.value, 1e5), rounded(v.sigma, 1e5)}; }
Valued valued(const Json& json) { return {number(json.at(0)), number(json.at(1))}; }

Json place(const std::optional<Eigen::Vector3d>& at) {
  if (!at) return nullptr;
  return {rounded(at->x(), 1e4), rounded(at->y(), 1e4), rounded(at->z(), 1e4)};
}
std::optional<Eigen::Vector3d> place(const Json& json) {
  if (!json.is_array()) return std::nullopt;
  return Eigen::Vector3d(number(json.at(0)), number(json.at(1)), number(json.at(2)));
}

Json middle_json(const std::optional<CorrectedRange>& range) {
  if (!range) return nullptr;
  return {place(std::optional(range->tag_m)), rounded(range->distance_m, 1e4),
          rounded(range->corrected_m, 1e4)};
}
std::optional<CorrectedRange> parse_middle(const Json& json) {
  if (!json.is_array()) return std::nullopt;
  return CorrectedRange{place(json.at(0)).value(), number(json.at(1)), number(json.at(2))};
}

Json course_json(const Convergence& course) {
  Json out = Json::object();
  for (const auto& [id, steps] : course) {
    Json& list = out[to_string(id)] = Json::array();
    for (const auto& s : steps)
      list.push_back({rounded(s.share, 1e4), s.n_ranges, place(s.raw_m), place(s.corrected_m),
                      rounded(s.h95_m, 1e4), k_verdict_words.word(s.verdict), s.n_los, s.n_nlos,
                      middle_json(s.middle)});
  }
  return out;
}

/// What was kept by versions before 0.2 has numbers in place of the words.
Verdict verdict_of(const Json& json) {
  if (const auto word = json.is_string() ? k_verdict_words.find(json.get_ref<const std::string&>())
                                         : k_verdict_words.of_number(json.get<std::int64_t>()))
    return *word;
  throw std::invalid_argument("unknown verdict " + to_wire(json));
}

Convergence parse_course(const Json& json) {
  Convergence course;
  for (const auto& [id, list] : json.items()) {
    auto& steps = course[parse_network_id(id).value()];
    for (const auto& s : list) {
      ConvergenceStep step;
      step.share = number(s.at(0));
      step.n_ranges = s.at(1).get<std::size_t>();
      step.raw_m = place(s.at(2));
      step.corrected_m = place(s.at(3));
      step.h95_m = number(s.at(4));
      step.verdict = verdict_of(s.at(5));
      if (s.size() > 6) {  // since 0.2
        step.n_los = s.at(6).get<std::size_t>();
        step.n_nlos = s.at(7).get<std::size_t>();
        step.middle = parse_middle(s.at(8));
      }
      steps.push_back(step);
    }
  }
  return course;
}

Json flight_json(const FlightEvidence& flight) {
  const auto& s = flight.shared;
  Json out{{"name", flight.name},          {"kit", flight.kit},        {"bias_m", valued(s.bias_m)},
           {"curve_m", valued(s.curve_m)}, {"lag_s", valued(s.lag_s)}, {"lever_up_m", valued(s.lever_up_m)}};
  out["bias_determined"] = s.bias_determined;
  out["bias_z"] = rounded(s.bias_z, 1e3);
  out["n"] = {flight.n_fixes, flight.n_ranges, flight.n_used};
  out["refused"] = flight.refused;
  out["notes"] = flight.notes;
  Json& track = out["track"] = Json::array();
  for (const auto& at : flight.track_m) track.push_back({rounded(at.x(), 1e2), rounded(at.y(), 1e2)});
  Json& residuals = out["residuals"] = Json::object();
  for (const auto& [id, rows] : flight.residuals) {
    Json& list = residuals[to_string(id)] = Json::array();
    for (const auto& r : rows)
      list.push_back({r.time.ns, rounded(r.distance_m, 1e4), rounded(r.residual_m, 1e4),
                      rounded(r.standardised, 1e3), rounded(r.weight, 1e6), rounded(r.tag_m.x(), 1e4),
                      rounded(r.tag_m.y(), 1e4), rounded(r.tag_m.z(), 1e4), rounded(r.corrected_m, 1e4),
                      rounded(r.sigma_m, 1e4)});
  }
  return out;
}

FlightEvidence parse_flight(const Json& json) {
  FlightEvidence flight;
  flight.name = json.at("name").get<std::string>();
  flight.kit = json.at("kit").get<std::string>();
  auto& s = flight.shared;
  s.bias_m = valued(json.at("bias_m"));
  s.curve_m = valued(json.at("curve_m"));
  s.lag_s = valued(json.at("lag_s"));
  s.lever_up_m = valued(json.at("lever_up_m"));
  s.bias_determined = json.at("bias_determined").get<bool>();
  s.bias_z = number(json.at("bias_z"));
  flight.n_fixes = json.at("n").at(0).get<std::size_t>();
  flight.n_ranges = json.at("n").at(1).get<std::size_t>();
  flight.n_used = json.at("n").at(2).get<std::size_t>();
  flight.refused = json.at("refused").get<std::map<std::string, std::size_t>>();
  flight.notes = json.at("notes").get<std::vector<std::string>>();
  for (const auto& at : json.at("track")) flight.track_m.emplace_back(number(at.at(0)), number(at.at(1)));
  for (const auto& [id, list] : json.at("residuals").items()) {
    auto& rows = flight.residuals[parse_network_id(id).value()];
    for (const auto& r : list) {
      RangeResidual row;
      row.time.ns = r.at(0).get<std::int64_t>();
      row.distance_m = number(r.at(1));
      row.residual_m = number(r.at(2));
      row.standardised = number(r.at(3));
      row.weight = number(r.at(4));
      if (r.size() < 10) {
        flight.observations = false;
      } else {
        row.tag_m = {number(r.at(5)), number(r.at(6)), number(r.at(7))};
        row.corrected_m = number(r.at(8));
        row.sigma_m = number(r.at(9));
      }
      rows.push_back(row);
    }
  }
  return flight;
}

/// Every k-th of the rows, so that at most `most` remain.
std::vector<RangeResidual> thinned(const std::vector<RangeResidual>& rows, std::size_t most) {
  if (rows.size() <= most) return rows;
  std::vector<RangeResidual> out;
  for (std::size_t i = 0; i < most; ++i) out.push_back(rows[i * rows.size() / most]);
  return out;
}

}  // namespace

FlightEvidence evidence_of(const FlightData& flight, const FlightSolution& solution,
                           const std::optional<Wgs84>& origin) {
  FlightEvidence out;
  out.name = flight.mission.name;
  out.kit = flight.mission.kit;
  out.shared = solution.shared;
  out.n_fixes = solution.n_fixes;
  out.n_ranges = solution.n_ranges;
  out.n_used = solution.n_used;
  out.refused = solution.refused;
  out.notes = solution.notes;
  const std::optional<EnuFrame> frame = origin ? std::optional<EnuFrame>(*origin) : std::nullopt;
  std::vector<const Fix*> fixes;
  for (const auto& fix : flight.fixes) fixes.push_back(&fix);
  std::ranges::stable_sort(fixes, {}, [](const Fix* fix) { return fix->time; });
  const std::size_t most = std::min(fixes.size(), k_max_track);
  for (std::size_t i = 0; i < most; ++i) {
    const Fix& fix = *fixes[i * fixes.size() / most];
    const bool globe = fix.frame == TrackFrame::wgs84;
    if (globe && !frame) continue;
    const Eigen::Vector3d at = globe ? frame->enu_from_wgs84(fix.position).m : fix.local_m;
    if (at.allFinite()) out.track_m.emplace_back(at.head<2>());
  }
  for (const auto& anchor : solution.anchors) {
    std::vector<RangeResidual> used, rejected;
    for (const auto& row : anchor.residuals) (row.weight > 0 ? used : rejected).push_back(row);
    auto kept = thinned(rejected, k_max_residuals * 2 / 5);
    const auto rest = thinned(used, k_max_residuals - kept.size());
    kept.insert(kept.end(), rest.begin(), rest.end());
    std::ranges::stable_sort(kept, {}, &RangeResidual::time);
    if (!kept.empty()) out.residuals[anchor.estimate.anchor] = std::move(kept);
  }
  return out;
}

std::string evidence_json(const Evidence& evidence) {
  Json out{{"flights", Json::array()}, {"course", course_json(evidence.course)}};
  for (const auto& flight : evidence.flights) out["flights"].push_back(flight_json(flight));
  return to_wire(out);
}

Result<Evidence> parse_evidence(std::string_view text) {
  try {  // the door of the JSON library: what we wrote ourselves is read without a check per field
    const Json json = Json::parse(text);
    Evidence evidence;
    for (const auto& flight : json.at("flights")) evidence.flights.push_back(parse_flight(flight));
    evidence.course = parse_course(json.at("course"));
    return evidence;
  } catch (const std::exception& fault) {
    return make_error(Errc::bad_frame, std::string("evidence of the calibration: ") + fault.what());
  }
}

}  // namespace anchord
