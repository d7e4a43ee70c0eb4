// The body of POST /calibrations.
#include <nlohmann/json.hpp>
#include <set>

#include "api/calibration/calibration_service.hpp"
#include "api/calibration/check_points_json.hpp"
#include "api/calibration/priors_json.hpp"
#include "api/formats/flight_json.hpp"
#include "api/kit/reader.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

constexpr double k_far_m = 20'000;  // of the origin, as for the track

/// The name that a field comes under: its own, or its former one, which is deprecated.
const char* name_in(Fields& fields, const char* name, const char* former) {
  const bool has_name = fields.child(name) != nullptr, has_former = fields.child(former) != nullptr;
  if (has_name && has_former)
    fields.error(former, "conflict", std::string("is the former name of ") + name + ": send one of them");
  return has_former ? former : name;
}

/// A word, or where to begin for each anchor that is named.
void read_initial(Fields& fields, const Json& initial, FlightOptions& options,
                  std::vector<FieldError>& errors) {
  if (initial.is_string()) {
    options.start_at_priors = fields.word("initial", k_initial_words).value_or(false);
    return;
  }
  if (!initial.is_object() || initial.size() > 1000)
    return fields.error(
        "initial", "wrong_type",
        "must be search, bearing_height, or an object: anchor id -> [east, north, up] in metres");
  Fields starts(initial, "/initial", errors);
  for (const auto& [id, place] : initial.items()) {
    if (const auto at = starts.numbers(id, 3, -k_far_m, k_far_m))
      options.starts[network_id_of(id)] = {(*at)[0], (*at)[1], (*at)[2]};
  }
  starts.finish();
}

/// None may occur twice, in whatever list.
void read_missions(Fields& fields, const char* key, std::set<std::string>& seen, std::vector<MissionId>& ids,
                   std::vector<FieldError>& errors) {
  const Json* list = fields.child(key);
  if (list == nullptr) return;
  if (!list->is_array() || list->empty() || list->size() > 100)
    return fields.error(key, "wrong_type", "must be an array of 1 to 100 mission ids");
  for (std::size_t i = 0; i < list->size(); ++i) {
    const auto& item = (*list)[i];
    const auto id = parse_uuid(item.is_string() ? item.get_ref<const std::string&>() : "");
    const std::string at = std::string("/") + key + '/' + std::to_string(i);
    if (!id)
      errors.push_back({at, "bad_id", id.error().message});
    else if (!seen.insert(to_string(id.value())).second)
      errors.push_back({at, "duplicate", "the mission occurs twice"});
    else
      ids.push_back(MissionId{id.value()});
  }
}

/// Held in the plane, a prior in space.
void read_height(Fields& fields, FlightOptions& options, std::vector<FieldError>& errors) {
  if (const auto height = fields.number("anchor_height_m", -1000, 9000)) {
    options.anchor_height_m = *height;
    if (options.dims != Dims::two)
      fields.error("anchor_height_m", "needs_dims_2",
                   "a held height needs dims 2; with dims 3 give height_prior");
  }
  if (const auto sigma = fields.number("anchor_height_sigma_m", 0.001, 100)) {
    options.anchor_height_sigma_m = *sigma;
    if (!options.anchor_height_m)
      fields.error("anchor_height_sigma_m", "needs_anchor_height_m",
                   "the sigma of a height needs that height");
  }
  const Json* prior = fields.child("height_prior");
  if (prior == nullptr) return;
  Fields inner(*prior, "/height_prior", errors);
  const auto height = inner.number("height_m", -1000, 9000, true);
  const auto sigma = inner.number("sigma_m", 0.01, 100, true);
  inner.finish();
  if (options.dims == Dims::two)
    fields.error("height_prior", "needs_dims_3",
                 "a height prior needs dims 3; with dims 2 give anchor_height_m");
  else if (height && sigma)
    options.height_prior = {*height, *sigma};
}

}  // namespace

CalibrationRequest read_calibration_request(const Json& body, std::vector<FieldError>& errors) {
  CalibrationRequest out;
  Fields fields(body, "", errors);
  std::set<std::string> seen;
  if (!fields.has("missions")) fields.error("missions", "required", "missions is missing");
  read_missions(fields, "missions", seen, out.missions, errors);
  read_missions(fields, "learn_from", seen, out.learn_from, errors);
  auto& options = out.options;
  if (const auto dims = fields.integer("dims", 2, 3)) options.dims = *dims == 2 ? Dims::two : Dims::three;
  if (const auto solver = fields.word("solver", k_solver_words)) options.method = *solver;
  if (const auto weights = fields.word("weights", k_weights_words)) options.weights = *weights;
  if (const Json* loss = fields.child("loss")) {
    Fields inner(*loss, "/loss", errors);
    if (const auto type = inner.word("type", k_loss_words, true)) options.loss = *type;
    // The robust scale comes from the residuals themselves; `scale` stretches it, 1.5 being the neutral value
    // of api.md.
    if (const auto scale = inner.number("scale", 0.1, 10)) options.mad_factor *= *scale / 1.5;
    inner.finish();
  }
  read_height(fields, options, errors);
  if (const auto gap = fields.number("max_gap_s", 0.01, 10)) options.max_gap_s = *gap;
  options.lever_arm_sigma_m =
      fields.number("lever_arm_sigma_m", k_least_lever_arm_sigma_m, k_most_lever_arm_sigma_m);
  if (const auto fix = fields.word("min_fix", k_fix_words)) options.min_fix = *fix;
  out.max_correction_age_s = fields.number("max_correction_age_s", 0.1, 3600);
  out.max_speed_mps = fields.number("max_speed_mps", 1, 1000);
  out.max_acceleration_mps2 = fields.number("max_acceleration_mps2", 1, 1000);
  if (const auto profile = fields.word("profile", k_profile_words)) out.use_profile = *profile;
  if (const auto steps = fields.integer("iterations", 0, 50)) out.iterations = static_cast<int>(*steps);
  if (const Json* sigma = fields.child("sigma_m")) {
    Fields inner(*sigma, "/sigma_m", errors);
    if ((out.noise.los_m = inner.number("los", 0.001, 1))) options.min_scale_m = *out.noise.los_m;
    if (const auto rtk = inner.number("rtk", 0, 1)) options.floor_sigma_m = *rtk;
    out.noise.nlos_m = inner.number("nlos", 0.001, 10);
    inner.finish();
  }
  if (const Json* initial = fields.child("initial")) read_initial(fields, *initial, options, errors);
  const char* name = name_in(fields, "priors", "clues");
  if (const Json* priors = fields.child(name)) read_priors(*priors, fields.pointer(name), options, errors);
  if (const Json* models = fields.child("models")) out.models = read_flight_models(*models, errors);
  // Kept with the settings and asked once everything is solved: no data.
  if (const Json* points = fields.child("check_points")) (void)read_check_points(*points, errors);
  out.flight_priors = fields.boolean(name_in(fields, "flight_priors", "flight_clues")).value_or(true);
  out.compare_uncorrected = fields.boolean("compare_uncorrected").value_or(true);
  // Who names a loss wants it: the likelihood of the models then takes its place only where asked for.
  out.likelihood = out.models.likelihood.value_or(!fields.has("loss"));
  if (auto frame = fields.text("frame", 80)) out.frame = std::move(*frame);
  out.use_anchor_anchor = fields.boolean("use_anchor_anchor").value_or(true);
  out.site_outline = fields.boolean("site_outline").value_or(true);
  fields.finish();
  out.body_json = to_wire(body);
  out.settings_json = body.is_object() ? [&] {
    Json settings = body;
    settings.erase("missions");
    return to_wire(settings);
  }() : "{}";
  return out;
}

}  // namespace anchord::api
