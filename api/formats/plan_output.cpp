#include "api/formats/plan_output.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;
using planning::Rule;

/// JSON has no infinity: a value that is singular is null.
Ordered finite_or_null(double value) { return std::isfinite(value) ? Ordered(value) : Ordered(nullptr); }

Ordered point_json(const Eigen::Vector3d& p, int dims) {
  return dims == 2 ? Ordered::array({p.x(), p.y()}) : Ordered::array({p.x(), p.y(), p.z()});
}

const char* value_name(Rule rule) {
  switch (rule) {
    case Rule::dissertation:
      return "gdop_trace";
    case Rule::a_optimal:
      return "position_variance_m2";
    case Rule::d_optimal:
      return "log_det_covariance";
  }
  return "";
}

Ordered candidate_json(const planning::Candidates& all, std::size_t i, const PlanRequest& request) {
  const planning::CandidateValue c = all[i];
  Ordered out;
  out["point_m"] = point_json(c.point_m, request.options.dims);
  out["value"] = finite_or_null(c.value);
  if (request.options.rule == Rule::dissertation) out["gdop_root"] = finite_or_null(std::sqrt(c.value));
  out["score"] = finite_or_null(c.score);
  Ordered anchors = Ordered::array();
  for (std::size_t k = 0; k < all.of_anchor.size(); ++k) {
    anchors.push_back(
        {{"name", request.input.anchors[k].name}, {"value", finite_or_null(all.of_anchor[k][i])}});
  }
  out["per_anchor"] = anchors;
  out["p_nlos"] = c.p_nlos;
  out["flight_s"] = c.flight_s;
  out["refused"] = c.refused ? Ordered(planning::to_string(*c.refused)) : Ordered(nullptr);
  return out;
}

}  // namespace

std::string decision_json(const planning::Decision& decision, const PlanRequest& request) {
  Ordered out;
  out["rule"] = planning::to_string(request.options.rule);
  out["combine"] = planning::to_string(request.options.combine);
  out["dims"] = request.options.dims;
  out["value_is"] = value_name(request.options.rule);
  out["next_m"] = decision.chosen
                      ? point_json(decision.candidates[*decision.chosen].point_m, request.options.dims)
                      : Ordered(nullptr);
  out["chosen"] = decision.chosen ? Ordered(*decision.chosen) : Ordered(nullptr);
  out["value"] =
      decision.chosen ? finite_or_null(decision.candidates[*decision.chosen].value) : Ordered(nullptr);
  out["value_before"] = finite_or_null(decision.value_before);
  out["reason"] = decision.reason;
  out["candidates"] = Ordered::array();
  for (std::size_t i = 0; i < decision.candidates.size(); ++i)
    out["candidates"].push_back(candidate_json(decision.candidates, i, request));
  return to_wire(out, 2) + "\n";
}

std::string decision_text(const planning::Decision& decision, const PlanRequest& request) {
  std::array<char, 256> line{};
  std::string out;
  if (decision.chosen) {
    const Eigen::Vector3d p = decision.candidates[*decision.chosen].point_m;
    std::snprintf(line.data(), line.size(), "next: (%.3f, %.3f, %.3f) m\n", p.x(), p.y(), p.z());
    out += line.data();
  }
  out += "why:  " + decision.reason + "\n\n";
  std::snprintf(line.data(), line.size(), "   %10s %10s %10s  %-22s %8s  %s\n", "x_m", "y_m", "z_m",
                value_name(request.options.rule), "flight_s", "refused");
  out += line.data();
  for (std::size_t i = 0; i < decision.candidates.size(); ++i) {
    const auto& c = decision.candidates[i];
    std::array<char, 32> value{};
    if (std::isfinite(c.value))
      std::snprintf(value.data(), value.size(), "%.9g", c.value);
    else
      std::snprintf(value.data(), value.size(), "singular");
    std::snprintf(line.data(), line.size(), "%s  %10.3f %10.3f %10.3f  %-22s %8.1f  %s\n",
                  decision.chosen == i ? "*" : " ", c.point_m.x(), c.point_m.y(), c.point_m.z(), value.data(),
                  c.flight_s, c.refused ? std::string(planning::to_string(*c.refused)).c_str() : "");
    out += line.data();
  }
  return out;
}

}  // namespace anchord::api
