#include <nlohmann/json.hpp>

#include "api/calibration/kit_profile_json.hpp"
#include "api/calibration/kit_profiles.hpp"
#include "api/calibration/routes.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/localize/kit_prior.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_history = 50;

std::string etag(std::uint64_t version) { return "\"k-" + std::to_string(version) + '"'; }

Ordered valued(double value, double sigma) { return {{"value", value}, {"sigma", sigma}}; }

Ordered version_json(const StoredProfile& stored) {
  return {
      {"version", stored.version}, {"t_us", stored.time.us()}, {"by", stored.by}, {"source", stored.source}};
}

/// The profile, the prior it gives the next flight, and where every version came from.
Response answer(CalibrationApi& s, int status, const StoredProfile& stored) {
  const auto profile = value_or_problem(parse_kit_profile(stored.profile.text));
  const FlightOptions options;
  const BiasGate gate = bias_gate(profile.factors, options);
  const SharedPrior prior = profile_prior(profile.factors, gate, options);
  const auto sigma = prior_sigmas(prior);
  Ordered body{{"kit", stored.kit}, {"version", stored.version}, {"n_flights", profile.factors.size()}};
  body["profile"] = Ordered::parse(stored.profile.text);
  body["next_flight"] = {{"bias_m", valued(prior.mean[k_shared_bias], sigma[k_shared_bias])},
                         {"curve_m_per_efold", valued(prior.mean[k_shared_curve], sigma[k_shared_curve])},
                         {"lag_s", valued(prior.mean[k_shared_lag], sigma[k_shared_lag])},
                         {"lever_up_m", valued(prior.mean[k_shared_lever], sigma[k_shared_lever])}};
  body["bias"] = {{"value_m", gate.bias_m},       {"sigma_m", gate.sigma_m},       {"z", gate.z},
                  {"limit", options.bias_gate_z}, {"calibrated", gate.calibrated}, {"known", gate.known}};
  Ordered history = Ordered::array();
  for (const auto& one : value_or_problem(s.profiles.store().history(stored.kit, k_history)))
    history.push_back(version_json(one));
  body["history"] = std::move(history);
  Response response = json_response(status, body);
  response.header("ETag", etag(stored.version));
  return response;
}

Response read(CalibrationApi& s, const Request& request) {
  check_query(request, {});
  const auto kit = value_or_problem(s.profiles.kit_of(request.params.at("id")));
  const auto stored = value_or_problem(s.profiles.store().profile(kit));
  if (!stored)
    throw_problem(
        404, "not-found",
        "kit " + kit + " has no profile yet: it is learned from the first calibration of its flights");
  return answer(s, 200, *stored);
}

/// If-Match names the version that is replaced; "*" makes the first one of a kit.
Response put(CalibrationApi& s, const Request& request) {
  const auto& id = request.params.at("id");
  const auto known = s.profiles.kit_of(id);
  const auto profile = parse_kit_profile(to_wire(json_body(request)));
  if (!profile)
    throw_problem(422, "validation", profile.error().message, {{"", "bad_profile", profile.error().message}});
  const std::string kit = known ? known.value() : profile.value().kit;
  if (profile.value().kit != kit || kit.empty())
    throw_problem(422, "validation", "the profile belongs to another kit",
                  {{"/kit", "other_kit", "must be '" + to_utf8(kit, 80) + "'"}});
  if (!known && id != kit) throw ProblemException{problem_of(known.error())};
  const auto before = value_or_problem(s.profiles.store().profile(kit));
  const std::uint64_t version = before ? before->version : 0;
  if (before || request.header("if-match") != "*") require_match(request, etag(version));
  StoredProfile next;
  next.kit = kit;
  next.time = s.clock.now();
  next.by = request.principal.token_id;
  next.source = "put";
  next.profile = {kit_profile_json(profile.value())};
  const auto stored = value_or_problem(s.profiles.store().put(std::move(next), version));
  s.audit(request, "profile.change " + kit + " version " + std::to_string(stored.version));
  return answer(s, before ? 200 : 201, stored);
}

}  // namespace

void add_kit_routes(Router& router, CalibrationApi& s) {
  router.add({Method::get, "/api/v1/devices/{id}/profile", readers(),
              [&s](const Request& request) { return read(s, request); }});
  router.add({Method::put, "/api/v1/devices/{id}/profile", Access::any_of({Role::engineer, Role::op}),
              [&s](const Request& request) { return put(s, request); }, 1 << 20, false, true});
}

}  // namespace anchord::api
