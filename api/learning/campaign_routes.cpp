#include <charconv>
#include <nlohmann/json.hpp>

#include "api/formats/csv_text.hpp"
#include "api/formats/names_alike.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/learning/campaign_rows.hpp"
#include "api/learning/campaign_schedule.hpp"
#include "api/learning/learning_json.hpp"
#include "api/learning/measurement_query.hpp"
#include "api/learning/range_features.hpp"
#include "api/learning/routes.hpp"
#include "api/wire/row_report.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::uint64_t k_max_import_bytes = 32ULL << 20;

CampaignRecord named_campaign(LearningApi& l, const Request& request) {
  const auto& text = request.params.at("id");
  if (const auto id = parse_uuid(text))
    return value_or_problem(l.stores.campaigns.campaign(CampaignId{id.value()}));
  return value_or_problem(l.stores.campaigns.campaign(text));
}

Response whole(LearningApi& l, int status, const CampaignRecord& campaign) {
  const auto settings = value_or_problem(l.stores.campaigns.settings(campaign.id));
  Response response = json_response(status, campaign_json(campaign, &settings));
  response.header("ETag", "\"c-" + std::to_string(campaign.version) + "\"");
  return response;
}

/// The grid of the dissertation's campaign: what is measured and, cell by cell, what is missing.
Response schedule(LearningApi& l, const Request& request) {
  check_query(request, {"environment", "los", "samples", "limit", "cursor"});
  const CampaignRecord campaign = named_campaign(l, request);
  const auto page = page_query(request, CampaignGrid::k_cells);
  const auto wanted = static_cast<std::size_t>(query_number(request, "samples", 1, 1e6).value_or(1));
  ScheduleFilter filter;
  filter.environment = request.query_value("environment");
  if (request.query_value("los")) filter.los = query_flag(request, "los");
  std::size_t from = 0;
  if (!page.cursor.empty()) {
    const auto* end = page.cursor.data() + page.cursor.size();
    const auto read = std::from_chars(page.cursor.data(), end, from);
    if (read.ec != std::errc{} || read.ptr != end)
      throw_problem(422, "validation", "cursor was not issued by this server",
                    {{"/cursor", "bad_cursor", "was not issued by this server"}});
  }
  const auto progress = campaign_progress(value_or_problem(l.stores.campaigns.settings(campaign.id)), filter);
  using Grid = CampaignGrid;
  Ordered distances = Ordered::array(), heights = Ordered::array(), headings = Ordered::array();
  for (std::size_t i = 0; i < Grid::k_heights; ++i) heights.push_back(Grid::height_m(i));
  for (std::size_t i = 0; i < Grid::k_headings; ++i) headings.push_back(Grid::heading_deg(i));
  Ordered by_distance = Ordered::array(), missing = Ordered::array();
  constexpr std::size_t k_each = Grid::k_heights * Grid::k_headings;
  std::string next;
  for (std::size_t i = 0; i < Grid::k_distances; ++i) {
    distances.push_back(Grid::distance_m(i));
    const auto first = progress.n_samples.begin() + static_cast<std::ptrdiff_t>(i * k_each);
    by_distance.push_back({{"distance_m", Grid::distance_m(i)},
                           {"n_planned", k_each},
                           {"n_measured", std::count_if(first, first + static_cast<std::ptrdiff_t>(k_each),
                                                        [&](std::size_t n) { return n >= wanted; })}});
  }
  for (std::size_t cell = from; cell < Grid::k_cells; ++cell) {
    if (progress.n_samples[cell] >= wanted) continue;
    if (missing.size() == page.limit) {
      next = std::to_string(cell);
      break;
    }
    missing.push_back({{"distance_m", Grid::distance_m(cell / k_each)},
                       {"height_difference_m", Grid::height_m(cell / Grid::k_headings % Grid::k_heights)},
                       {"heading_deg", Grid::heading_deg(cell % Grid::k_headings)},
                       {"n_samples", progress.n_samples[cell]}});
  }
  return json_response(200, {{"campaign", to_string(campaign.id)},
                             {"grid",
                              {{"distance_m", std::move(distances)},
                               {"height_difference_m", std::move(heights)},
                               {"heading_deg", std::move(headings)}}},
                             {"samples_wanted", wanted},
                             {"n_planned", Grid::k_cells},
                             {"n_measured", progress.n_measured(wanted)},
                             {"n_samples_off_grid", progress.n_off_grid},
                             {"by_distance", std::move(by_distance)},
                             {"missing", std::move(missing)},
                             {"next_cursor", next.empty() ? Ordered(nullptr) : Ordered(next)}});
}

Response list_campaigns(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<CampaignId>(
      request,
      [&](std::size_t limit, const std::optional<CampaignId>& after) {
        return l.stores.campaigns.campaigns(limit, after);
      },
      [&](const auto& campaign) { return campaign_json(campaign, nullptr); });
}

Response create_campaign(LearningApi& l, const Request& request) {
  std::vector<FieldError> errors;
  CampaignRecord campaign;
  patch_campaign(json_body(request), true, campaign, errors);
  refuse_if_any(errors);
  campaign.created = l.clock.now();
  campaign.id.uuid = make_uuid_v7(campaign.created);
  value_or_problem(l.stores.campaigns.insert(campaign));
  l.audit(request, "campaign.create " + to_string(campaign.id));
  Response response = whole(l, 201, campaign);
  response.header("Location", "/api/v1/campaigns/" + to_string(campaign.id));
  return response;
}

Response change_campaign(LearningApi& l, const Request& request) {
  CampaignRecord campaign = named_campaign(l, request);
  require_match(request, "\"c-" + std::to_string(campaign.version) + "\"");
  std::vector<FieldError> errors;
  patch_campaign(json_body(request), false, campaign, errors);
  refuse_if_any(errors);
  value_or_problem(l.stores.campaigns.update(campaign, campaign.version));
  l.audit(request, "campaign.change " + to_string(campaign.id));
  return whole(l, 200, value_or_problem(l.stores.campaigns.campaign(campaign.id)));
}

Response import(LearningApi& l, const Request& request) {
  check_query(request, {"dry_run", "environment", "setting", "material", "distance_m", "heading_deg",
                        "height_difference_m", "thickness_m", "los", "los_value"});
  const CampaignRecord campaign = named_campaign(l, request);
  const bool dry_run = query_flag(request, "dry_run");
  auto read = read_campaign_rows(request);
  CampaignStore::Appended done;
  if (dry_run && !read.rows.empty()) {
    done = value_or_problem(l.stores.campaigns.would_append(campaign.id, read.rows, read.untimed));
  } else if (!read.rows.empty()) {
    done = value_or_problem(l.stores.campaigns.append(campaign.id, read.rows, read.untimed));
    l.audit(request,
            "campaign.import " + to_string(campaign.id) + " " + std::to_string(done.accepted) + " samples");
  }
  Ordered report = Ordered::parse(read.report_json);
  report["accepted"] = done.accepted;
  report["duplicates"] = done.duplicates;
  // A place of this file may differ in capitals from one that is stored.
  std::vector<std::string> environments, settings;
  for (const auto& row : read.rows) {
    environments.push_back(row.truth.environment);
    settings.push_back(row.truth.setting);
  }
  for (const auto& one : value_or_problem(l.stores.campaigns.settings(campaign.id))) {
    environments.push_back(one.truth.environment);
    settings.push_back(one.truth.setting);
  }
  for (const auto& [what, names] :
       {std::pair("environments", &environments), std::pair("settings", &settings)})
    for (auto& warning : names_alike(what, *names)) report["warnings"].push_back(std::move(warning));
  if (dry_run) report["dry_run"] = true;
  return row_report(report, read.rows.empty(), "no row can be used; nothing was stored");
}

struct SamplePage {
  std::vector<CampaignStore::StoredSample> rows;
  std::int64_t next{};  ///< 0 at the end
};

/// One page; of a class where one is asked for: then it may hold fewer rows than the limit and yet go on.
Result<SamplePage> sample_page(CampaignStore& store, const ModelRegistry::Active& active,
                               std::optional<PredictedClass> wanted, CampaignStore::Filter filter) {
  const std::size_t limit = filter.limit;
  SamplePage out;
  for (std::size_t looked = 0; out.rows.size() < limit && looked < k_class_scan_max;) {
    const std::size_t here = limit - out.rows.size();
    filter.limit = here + 1;  // one more than asked tells whether there is a next page
    BOOST_OUTCOME_TRY(auto rows, store.samples(filter));
    const bool more = rows.size() > here;
    if (more) rows.pop_back();
    looked += rows.size();
    out.next = more ? rows.back().id : 0;
    filter.after = out.next;
    for (auto& row : rows) {
      if (wanted && class_of(ModelRegistry::predict(active, features_of(row.sample, row.truth))) != *wanted)
        continue;
      out.rows.push_back(std::move(row));
    }
    if (!more) break;
  }
  return out;
}

constexpr const char* k_sample_header =
    "id,t_us,seq,environment,setting,true_distance_m,los,heading_deg,height_difference_m,material,thickness_"
    "m,truth_sigma_m,range_m,rx_dbm,fp_dbm,fp_amp1,fp_amp2,fp_amp3,cir_power,preamble_count,std_noise,max_"
    "noise,fp_index\r\n";
/// By the names an import knows, so that what is taken out can be brought in again.
std::string sample_csv(const CampaignStore::StoredSample& s) {
  const auto number = [](const auto& v) { return v ? to_wire(Ordered(*v)) : std::string(); };
  const auto& x = s.sample;
  const auto& truth = s.truth;
  return std::to_string(s.id) + ',' + (x.time ? std::to_string(x.time->us()) : "") + ',' + number(x.seq) +
         ',' + csv_text(truth.environment) + ',' + csv_text(truth.setting) + ',' + number(truth.distance_m) +
         ',' + (truth.los ? (*truth.los ? "1" : "0") : "") + ',' + number(truth.heading_deg) + ',' +
         number(truth.height_difference_m) + ',' + csv_text(truth.material) + ',' +
         number(truth.thickness_m) + ',' + number(truth.truth_sigma_m) + ',' + to_wire(Ordered(x.range_m)) +
         ',' + number(x.rx_dbm) + ',' + number(x.fp_dbm) + ',' + number(x.fp_amp1) + ',' + number(x.fp_amp2) +
         ',' + number(x.fp_amp3) + ',' + number(x.cir_power) + ',' + number(x.preamble_count) + ',' +
         number(x.std_noise) + ',' + number(x.max_noise) + ',' + number(x.fp_index) + "\r\n";
}

Response samples(LearningApi& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "format", "setting", "environment", "los", "features",
                        "min_distance_m", "max_distance_m", "min_level_dbm", "max_level_dbm", "label",
                        "class", "predicted", "every"});
  const auto page = page_query(request, 10'000);
  const bool with_features = query_flag(request, "features");
  CampaignStore::Filter filter;
  filter.campaign = named_campaign(l, request).id;
  filter.setting = request.query_value("setting");
  filter.environment = request.query_value("environment");
  filter.limits = query_limits(request);
  if (request.query_value("los"))
    filter.limits.label =
        query_flag(request, "los") ? MeasurementLimits::Label::los : MeasurementLimits::Label::nlos;
  filter.every = query_every(request);
  const auto wanted = query_class(request);
  const bool judged = wanted || query_flag(request, "predicted");
  const auto active = l.models.active();
  filter.limit = page.limit;
  filter.with_cir = with_features || (judged && active->needs_cir);
  if (!page.cursor.empty()) {
    const auto [end, error] =
        std::from_chars(page.cursor.data(), page.cursor.data() + page.cursor.size(), filter.after);
    if (error != std::errc{} || end != page.cursor.data() + page.cursor.size())
      throw_problem(422, "validation", "cursor was not issued by this server",
                    {{"/cursor", "bad_cursor", "was not issued by this server"}});
  }
  const auto item_of = [with_features, judged, active](const CampaignStore::StoredSample& row) {
    Ordered item = sample_json(row);
    if (!with_features && !judged) return item;
    const auto features = features_of(row.sample, row.truth);
    if (with_features) item["features"] = features_json(features);
    if (judged) item["predicted"] = predicted_json(ModelRegistry::predict(*active, features));
    return item;
  };
  const std::string format = negotiate(request, {"json", "ndjson", "csv"});
  if (format == "json") {
    const auto found = value_or_problem(sample_page(l.stores.campaigns, *active, wanted, filter));
    Ordered items = Ordered::array();
    for (const auto& row : found.rows) items.push_back(item_of(row));
    return list_response(request, std::move(items), found.next ? std::to_string(found.next) : "");
  }
  const bool csv = format == "csv";
  filter.limit = 1000;
  Response response;
  response.header("Content-Type", csv ? "text/csv; charset=utf-8" : "application/x-ndjson");
  response.body_stream = [&store = l.stores.campaigns, active, wanted, filter, item_of, csv, begun = false,
                          done = false]() mutable -> std::string {
    std::string out = csv && !begun ? k_sample_header : "";
    begun = true;
    while (out.empty() && !done) {
      const auto found = sample_page(store, *active, wanted, filter);
      // The status is sent already; an early end is all that can still be told.
      if (!found) throw BodyError(503, found.error().message);
      for (const auto& row : found.value().rows) out += csv ? sample_csv(row) : to_wire(item_of(row)) + '\n';
      filter.after = found.value().next;
      done = filter.after == 0;
    }
    return out;
  };
  return response;
}

/// The impulse response a sample came with, as that of a range.
Response sample_cir(LearningApi& l, const Request& request) {
  check_query(request, {"format"});
  const auto& text = request.params.at("sample");
  std::int64_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc{} || end != text.data() + text.size())
    throw_problem(404, "not-found", "no sample " + to_utf8(text, 40));
  const auto row = value_or_problem(l.stores.campaigns.sample(named_campaign(l, request).id, id));
  if (!row.sample.cir) throw_problem(404, "not-found", "this sample has no impulse response");
  if (negotiate(request, {"json", "binary"}) == "json") return json_response(200, cir_json(*row.sample.cir));
  Response response;
  response.header("Content-Type", "application/octet-stream");
  response.body = cir_bytes(*row.sample.cir);
  return response;
}

/// Ground truth of a flight's ranges, told afterwards: PATCH /ranges with a filter.
Response label(LearningApi& l, const Request& request) {
  check_query(request, {"mission", "anchor", "tag", "since", "until"});
  const auto mission = query_mission(request);
  if (!mission)
    throw_problem(422, "validation", "mission is missing",
                  {{"/mission", "required", "give the mission of the ranges"}});
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  RangeTruth truth;
  truth.distance_m = fields.number("distance_m", 0.01, 10'000);
  truth.los = fields.boolean("los");
  fields.finish();
  if (!truth.distance_m && !truth.los && errors.empty())
    errors.push_back({"/los", "required", "give los, distance_m or both"});
  refuse_if_any(errors);
  const LabelStore::Filter filter{*mission, query_network_id(request, "anchor"),
                                  query_network_id(request, "tag"), query_time(request, "since"),
                                  query_time(request, "until")};
  const auto n = value_or_problem(l.stores.labels.label(filter, truth));
  l.audit(request, "ranges.label " + to_string(*mission) + " " + std::to_string(n));
  return json_response(200, {{"labelled", n}});
}

/// A training that runs stands on a data set of these campaigns: its report would name one that is gone.
void refuse_while_trained_on(LearningApi& l, const CampaignRecord& campaign) {
  for (const auto& job : value_or_problem(l.job_store.jobs(1000, std::nullopt))) {
    if (job.kind != "training" || (job.state != JobState::queued && job.state != JobState::running)) continue;
    const auto run = l.stores.runs.run(TrainingRunId{job.id.uuid});
    if (!run) continue;
    const auto dataset = l.stores.datasets.dataset(run.value().dataset);
    if (dataset && dataset.value().query.text.find(to_string(campaign.id)) != std::string::npos)
      throw_problem(409, "conflict",
                    "training run " + to_string(job.id) + " uses " + campaign.name + " (" +
                        (job.state == JobState::running ? "running" : "queued") +
                        "): wait for it, or cancel its job first");
  }
}

}  // namespace

void add_campaign_routes(Router& router, LearningApi& l) {
  const auto on = [&l](auto function) {
    return [&l, function](const Request& request) { return function(l, request); };
  };
  const auto writers = Access::any_of({Role::gateway, Role::engineer});
  router.add({Method::get, "/api/v1/campaigns", readers(), on(list_campaigns)});
  router.add({Method::post, "/api/v1/campaigns", writers, on(create_campaign)});
  router.add({Method::get, "/api/v1/campaigns/{id}", readers(), [&l](const Request& request) {
                check_query(request, {});
                return whole(l, 200, named_campaign(l, request));
              }});
  router.add({Method::patch, "/api/v1/campaigns/{id}", writers, on(change_campaign), 1 << 20, false, true});
  router.add(
      {Method::del, "/api/v1/campaigns/{id}", Access::any_of({Role::engineer}), [&l](const Request& request) {
         const auto campaign = named_campaign(l, request);
         refuse_while_trained_on(l, campaign);
         value_or_problem(l.stores.campaigns.remove(campaign.id));
         l.audit(request, "campaign.delete " + to_string(campaign.id) + " " + campaign.name);
         Response response;
         response.status = 204;
         return response;
       }});
  router.add({Method::get, "/api/v1/campaigns/{id}/schedule", readers(), on(schedule)});
  router.add(as_heavy({Method::patch, "/api/v1/ranges", Access::any_of({Role::engineer}), on(label)}));
  router.add(as_heavy({Method::get, "/api/v1/campaigns/{id}/samples", readers(), on(samples)}));
  router.add({Method::get, "/api/v1/campaigns/{id}/samples/{sample}/cir", readers(), on(sample_cir)});
  router.add(
      as_heavy({Method::post, "/api/v1/campaigns/{id}/samples", writers, on(import), k_max_import_bytes}));
}

}  // namespace anchord::api
