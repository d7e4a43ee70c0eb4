#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/calibration/position_diff.hpp"
#include "api/calibration/routes.hpp"
#include "api/kit/support.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/text.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

double millimetres(double value) { return std::round(value * 1e4) / 1e4; }

Ordered side(const PlacedEstimate* at) {
  if (at == nullptr) return nullptr;
  const auto& e = at->estimate;
  return {{"verdict", k_verdict_words.word(e.verdict)},
          {"acceptable", e.acceptable()},
          {"h95_m", e.best ? Ordered(millimetres(e.h95_m)) : Ordered(nullptr)},
          {"v95_m", e.best ? Ordered(millimetres(e.v95_m)) : Ordered(nullptr)},
          {"n_ranges", e.n_used}};
}

const char* change_word(const PositionChange& change) {
  if (change.before == nullptr) return "added";
  if (change.now == nullptr) return "removed";
  if (!change.delta_m) return "not_comparable";
  return change.moved() ? "moved" : "agrees";
}

Ordered change_json(const PositionChange& change) {
  Ordered out{{"network_id", to_string(change.anchor)}, {"change", change_word(change)}};
  const bool both = change.delta_m.has_value();
  out["delta_enu_m"] = nullptr;
  if (both)
    out["delta_enu_m"] = {millimetres(change.delta_m->x()), millimetres(change.delta_m->y()),
                          millimetres(change.delta_m->z())};
  out["horizontal_m"] = both ? Ordered(millimetres(change.delta_m->head<2>().norm())) : Ordered(nullptr);
  out["vertical_m"] = both ? Ordered(millimetres(change.delta_m->z())) : Ordered(nullptr);
  const auto finite = [](double v) { return std::isfinite(v) ? Ordered(v) : Ordered(nullptr); };
  out["chi2"] = change.gate && change.gate->value ? finite(*change.gate->value) : Ordered(nullptr);
  out["chi2_limit"] = change.gate ? finite(change.gate->limit) : Ordered(nullptr);
  out["now"] = side(change.now);
  out["before"] = side(change.before);
  return out;
}

/// A revision that exists, by its number.
std::optional<std::uint64_t> revision_number(const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (fault != std::errc{} || end != text.data() + text.size() || number == 0) return std::nullopt;
  return number;
}

/// What `against` names: a calibration's id, a revision's number, or "published" (the default).
PlacedEstimates other(CalibrationApi& s, const Request& request, std::string fallback, std::string& name) {
  name = request.query_value("against").value_or(std::move(fallback));
  if (const auto id = parse_uuid(name))
    return placed(value_or_problem(s.calibration_store.calibration(CalibrationId{id.value()})));
  if (name == "published") return placed(value_or_problem(s.revisions.published(std::nullopt)));
  if (const auto number = revision_number(name))
    return placed(value_or_problem(s.revisions.published(*number)));
  if (name == "nothing") return {};
  throw_problem(
      422, "validation", "against must be a calibration, a revision or \"published\"",
      {{"/against", "unknown_value", "must be an id of a calibration, a number, or \"published\""}});
}

Response answer(const std::string& of, const std::string& against, const PlacedEstimates& now,
                const PlacedEstimates& before) {
  Ordered items = Ordered::array();
  std::size_t moved = 0;
  for (const auto& change : changes(now, before)) {
    if (change.moved()) ++moved;
    items.push_back(change_json(change));
  }
  return json_response(200,
                       {{"of", of}, {"against", against}, {"n_moved", moved}, {"items", std::move(items)}});
}

Response calibration_diff(CalibrationApi& s, const Request& request) {
  check_query(request, {"against"});
  const auto calibration = value_or_problem(s.calibration_store.calibration(path_id<CalibrationId>(request)));
  std::string against;
  const auto before = other(s, request, "published", against);
  return answer(to_string(calibration.id), against, placed(calibration), before);
}

Response revision_diff(CalibrationApi& s, const Request& request) {
  check_query(request, {"against"});
  const auto& text = request.params.at("number");
  const auto number = revision_number(text);
  if (!number) throw_problem(404, "not-found", "there is no revision " + to_utf8(text, 20));
  const auto now = placed(value_or_problem(s.revisions.published(*number)));
  std::string against;
  const auto before = other(s, request, *number > 1 ? std::to_string(*number - 1) : "nothing", against);
  return answer(text, against, now, before);
}

}  // namespace

void add_comparison_routes(Router& router, CalibrationApi& s) {
  router.add(as_heavy({Method::get, "/api/v1/calibrations/{id}/diff", readers(),
                       [&s](const Request& request) { return calibration_diff(s, request); }}));
  router.add(as_heavy({Method::get, "/api/v1/revisions/{number}/diff", readers(),
                       [&s](const Request& request) { return revision_diff(s, request); }}));
}

}  // namespace anchord::api
