#include "server/cli/site_learning.hpp"

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "api/wire/rows_json.hpp"
#include "core/base/to_wire.hpp"
#include "server/cli/rest_json.hpp"
#include "server/flight/demonstration_campaign.hpp"

namespace anchord::cli {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

constexpr const char* k_campaign = "Demonstration rooms";
constexpr const char* k_dataset = "Demonstration rooms, frozen";

std::string in_path(std::string name) {
  for (std::size_t at = 0; (at = name.find(' ', at)) != std::string::npos;) name.replace(at, 1, "%20");
  return name;
}

template <class Value>
void put(Ordered& row, const char* key, const std::optional<Value>& value) {
  if (value) row[key] = *value;
}

Ordered row_of(const CampaignSite& site, const CampaignMeasurement& m) {
  Ordered row{{"environment", site.environment}, {"setting", site.name}, {"range_m", m.range_m}};
  if (!site.material.empty()) row["material"] = site.material;
  put(row, "true_distance_m", site.distance_m);
  put(row, "los", site.los);
  put(row, "heading_deg", site.heading_deg);
  put(row, "height_difference_m", site.height_m);
  put(row, "thickness_m", site.thickness_m);
  put(row, "rx_dbm", m.rx_dbm);
  put(row, "fp_dbm", m.fp_dbm);
  put(row, "std_noise", m.std_noise);
  if (m.cir) row["cir"] = api::cir_json(*m.cir);
  return row;
}

/// Whether `path` is there.
Result<std::optional<Json>> found(RestClient& client, const std::string& path) {
  auto json = get_json(client, path);
  if (!json && json.error().code == Errc::not_found) return std::optional<Json>{};
  if (!json) return json.error();
  return std::optional(std::move(json).value());
}

/// One request per environment; a part that came before an interruption is known by its digest.
Result<void> add_campaign(RestClient& client, const Told& told) {
  const std::string path = "/api/v1/campaigns/" + in_path(k_campaign);
  BOOST_OUTCOME_TRY(const auto there, found(client, path));
  if (!there) {
    BOOST_OUTCOME_TRYV(post_json(client, "/api/v1/campaigns",
                                 {{"name", k_campaign},
                                  {"radio", "DW1000 channel 2"},
                                  {"note", "Simulated: the radio of the demonstration flight"}}));
  }
  const auto campaign = flight::demonstration_campaign();
  std::map<std::string, std::string> bodies;
  for (const auto& m : campaign.measurements) {
    const auto& site = campaign.sites[m.site];
    bodies[site.environment] += to_wire(row_of(site, m)) + '\n';
  }
  std::uint64_t added = 0;
  for (const auto& [environment, body] : bodies) {
    BOOST_OUTCOME_TRY(const auto answer, client.post(path + "/samples", "application/x-ndjson", body));
    added += Json::parse(answer, nullptr, false).value("accepted", std::uint64_t{0});
  }
  told("campaign \"" + std::string(k_campaign) + "\": " + std::to_string(added) + " samples added, of " +
       std::to_string(campaign.sites.size()) + " settings in " + std::to_string(bodies.size()) +
       " environments");
  return boost::outcome_v2::success();
}

Result<void> add_dataset(RestClient& client, const Told& told) {
  BOOST_OUTCOME_TRY(const auto there, found(client, "/api/v1/datasets/" + in_path(k_dataset)));
  if (there) {
    told("campaign \"" + std::string(k_campaign) + "\" and data set \"" + k_dataset + "\": already exists");
    return boost::outcome_v2::success();
  }
  BOOST_OUTCOME_TRYV(add_campaign(client, told));
  BOOST_OUTCOME_TRY(const auto made,
                    post_json(client, "/api/v1/datasets",
                              {{"name", k_dataset},
                               {"campaigns", {k_campaign}},
                               {"aggregation", "none"},
                               {"split", {{"by", "environment"}, {"test", {"depot", "yard"}}}}}));
  told("data set \"" + std::string(k_dataset) + "\" frozen: " + std::to_string(made.value("train", 0)) +
       " rows to train on, " + std::to_string(made.value("test", 0)) + " held out");
  return boost::outcome_v2::success();
}

/// One model of the demonstration.
struct Lesson {
  const char* task;
  std::vector<std::string> features;  ///< none: those that every row has
};

/// The class from the shape of the impulse response, by which half as much NLOS is called LOS as by levels.
/// Every seventh range is too weak for a first path: the bias model needs levels only, corrects all of them,
/// and says the class of these.
const std::vector<Lesson>& lessons() {
  static const std::vector<Lesson> k_lessons{
      {"nlos_id",
       {"range_db", "rx_free_space_db", "rx_minus_fp_db", "kurtosis", "mean_excess_delay_ns",
        "rms_delay_spread_ns", "early_energy"}},
      {"bias", {}}};
  return k_lessons;
}

/// Path of the model that was trained on the data set; trains it where no run has.
Result<std::string> trained_model(RestClient& client, const Lesson& lesson, const Told& told) {
  BOOST_OUTCOME_TRY(const auto runs,
                    get_items(client, std::string("/api/v1/training-runs?task=") + lesson.task));
  for (const auto& run : runs) {
    if (text_of(run.value("dataset", Json::object()), "name") != k_dataset) continue;
    if (const auto model = text_of(run, "model"); !model.empty()) return model;
  }
  told(std::string("training ") + lesson.task + " ...");
  Json request{{"task", lesson.task}, {"dataset", k_dataset}, {"cv", {{"folds", 4}, {"seed", 7}}}};
  if (!lesson.features.empty()) request["features"] = lesson.features;
  BOOST_OUTCOME_TRY(const auto job, post_json(client, "/api/v1/training-runs", request));
  BOOST_OUTCOME_TRY(const auto result, result_of_job(client, job));
  BOOST_OUTCOME_TRY(const auto run, get_json(client, result));
  const auto model = text_of(run, "model");
  if (model.empty()) return make_error(Errc::invalid_argument, result + ": the run has no model");
  told("trained: " + text_of(run, "method") + ", " + model);
  return model;
}

}  // namespace

Result<void> add_demonstration_model(RestClient& client, bool over_others, const Told& told) {
  BOOST_OUTCOME_TRYV(add_dataset(client, told));
  std::map<std::string, std::string> ours;  // path of the model by task
  for (const auto& lesson : lessons()) {
    BOOST_OUTCOME_TRY(ours[lesson.task], trained_model(client, lesson, told));
  }
  BOOST_OUTCOME_TRY(const auto active, get_json(client, "/api/v1/models/active"));
  const auto models = active.value("models", Json::object());
  for (const auto& [task, other] : models.items()) {
    if (over_others || !other.is_object()) continue;
    const auto id = text_of(other, "id");
    if (const auto one = ours.find(task); one != ours.end() && one->second == "/api/v1/models/" + id)
      continue;
    told("not promoted: model " + id + " is active (" + task +
         "); with --over-others it is promoted anyway, if it passes the gate");
    return boost::outcome_v2::success();
  }
  for (const auto& [task, model] : ours) {
    const auto now = models.value(task, Json());
    if (now.is_object() && "/api/v1/models/" + text_of(now, "id") == model) {
      told("the model of " + task + " is already the active one");
      continue;
    }
    BOOST_OUTCOME_TRYV(post_json(client, model + "/promote", Json::object()));
    told("model of " + task + " promoted through the gate");
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::cli
