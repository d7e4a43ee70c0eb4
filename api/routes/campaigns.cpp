#include <charconv>
#include <nlohmann/json.hpp>

#include "api/json/reader.hpp"
#include "api/json/wire_learning.hpp"
#include "api/json/wire_rows.hpp"
#include "api/learning/campaign_rows.hpp"
#include "api/learning/range_features.hpp"
#include "api/routes/learning.hpp"
#include "api/routes/support.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::uint64_t k_max_import_bytes = 32ULL << 20;

CampaignRecord named(LearningServices& l, const Request& request) {
  const auto& text = request.params.at("id");
  if (const auto id = parse_uuid(text))
    return value_or_problem(l.stores.campaigns.campaign(CampaignId{id.value()}));
  return value_or_problem(l.stores.campaigns.campaign(text));
}

Response whole(LearningServices& l, int status, const CampaignRecord& campaign) {
  const auto settings = value_or_problem(l.stores.campaigns.settings(campaign.id));
  Response response = json_response(status, campaign_json(campaign, &settings));
  response.header("ETag", "\"c-" + std::to_string(campaign.version) + "\"");
  return response;
}

Response list(LearningServices& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  const auto page = page_query(request);
  auto rows =
      value_or_problem(l.stores.campaigns.campaigns(page.limit + 1, cursor_id<CampaignId>(page.cursor)));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& campaign : rows) items.push_back(campaign_json(campaign, nullptr));
  return list_response(request, std::move(items), more ? to_string(rows.back().id) : "");
}

Response create(LearningServices& l, const Request& request) {
  std::vector<FieldError> errors;
  CampaignRecord campaign;
  patch_campaign(json_body(request), true, campaign, errors);
  refuse_if_any(errors);
  campaign.created = l.services.deps.clock.now();
  campaign.id.uuid = make_uuid_v7(campaign.created);
  value_or_problem(l.stores.campaigns.insert(campaign));
  l.services.audit(request, "campaign.create " + to_string(campaign.id));
  Response response = whole(l, 201, campaign);
  response.header("Location", "/api/v1/campaigns/" + to_string(campaign.id));
  return response;
}

Response patch(LearningServices& l, const Request& request) {
  CampaignRecord campaign = named(l, request);
  require_match(request, "\"c-" + std::to_string(campaign.version) + "\"");
  std::vector<FieldError> errors;
  patch_campaign(json_body(request), false, campaign, errors);
  refuse_if_any(errors);
  value_or_problem(l.stores.campaigns.update(campaign, campaign.version));
  l.services.audit(request, "campaign.change " + to_string(campaign.id));
  return whole(l, 200, value_or_problem(l.stores.campaigns.campaign(campaign.id)));
}

Response import(LearningServices& l, const Request& request) {
  check_query(request, {"dry_run", "environment", "setting", "material", "distance_m", "heading_deg",
                        "height_difference_m", "thickness_m", "los"});
  const CampaignRecord campaign = named(l, request);
  const bool dry_run = query_flag(request, "dry_run");
  auto read = read_campaign_rows(request);
  CampaignStore::Appended done;
  if (!dry_run && !read.rows.empty()) {
    done = value_or_problem(l.stores.campaigns.append(campaign.id, read.rows));
    l.services.audit(request, "campaign.import " + to_string(campaign.id) + " " +
                                  std::to_string(done.accepted) + " samples");
  }
  Ordered report = Ordered::parse(read.report_json);
  report["accepted"] = dry_run ? read.rows.size() : done.accepted;
  report["duplicates"] = done.duplicates;
  if (dry_run) report["dry_run"] = true;
  return json_response(200, report);
}

Response samples(LearningServices& l, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "setting", "environment", "los", "features"});
  const auto page = page_query(request, 10'000);
  const bool with_features = query_flag(request, "features");
  CampaignStore::Filter filter;
  filter.campaign = named(l, request).id;
  filter.setting = request.query_value("setting");
  filter.environment = request.query_value("environment");
  if (request.query_value("los")) filter.los = query_flag(request, "los");
  filter.limit = page.limit + 1;
  filter.with_cir = with_features;
  if (!page.cursor.empty()) {
    const auto [end, error] =
        std::from_chars(page.cursor.data(), page.cursor.data() + page.cursor.size(), filter.after);
    if (error != std::errc{} || end != page.cursor.data() + page.cursor.size())
      throw_problem(422, "validation", "cursor is not one of ours",
                    {{"/cursor", "bad_cursor", "is not one of ours"}});
  }
  auto rows = value_or_problem(l.stores.campaigns.samples(filter));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& row : rows) {
    Ordered item = sample_json(row);
    if (with_features) item["features"] = features_json(features_of(row.sample, row.truth));
    items.push_back(std::move(item));
  }
  return list_response(request, std::move(items), more ? std::to_string(rows.back().id) : "");
}

/// The impulse response a sample came with, as that of a range.
Response sample_cir(LearningServices& l, const Request& request) {
  check_query(request, {"format"});
  const auto& text = request.params.at("sample");
  std::int64_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc{} || end != text.data() + text.size())
    throw_problem(404, "not-found", "no sample " + text.substr(0, 40));
  const auto row = value_or_problem(l.stores.campaigns.sample(named(l, request).id, id));
  if (!row.sample.cir) throw_problem(404, "not-found", "this sample came without an impulse response");
  if (negotiate(request, {"json", "binary"}) == "json") return json_response(200, cir_json(*row.sample.cir));
  Response response;
  response.header("Content-Type", "application/octet-stream");
  response.body = cir_bytes(*row.sample.cir);
  return response;
}

/// Ground truth of a flight's ranges, told afterwards: PATCH /ranges with a filter.
Response label(LearningServices& l, const Request& request) {
  check_query(request, {"mission", "anchor", "tag", "since", "until"});
  const auto mission = query_mission(request);
  if (!mission)
    throw_problem(422, "validation", "mission is missing",
                  {{"/mission", "required", "say whose ranges are meant"}});
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  RangeTruth truth;
  truth.distance_m = fields.number("distance_m", 0.01, 10'000);
  truth.los = fields.boolean("los");
  fields.finish();
  if (!truth.distance_m && !truth.los && errors.empty())
    errors.push_back({"/los", "required", "say los, distance_m or both"});
  refuse_if_any(errors);
  const LabelStore::Filter filter{*mission, query_network_id(request, "anchor"),
                                  query_network_id(request, "tag"), query_time(request, "since"),
                                  query_time(request, "until")};
  const auto n = value_or_problem(l.stores.labels.label(filter, truth));
  l.services.audit(request, "ranges.label " + to_string(*mission) + " " + std::to_string(n));
  return json_response(200, {{"labelled", n}});
}

}  // namespace

void add_campaign_routes(Router& router, LearningServices& l) {
  const auto on = [&l](auto function) {
    return [&l, function](const Request& request) { return function(l, request); };
  };
  const auto writers = Access::any_of({Role::gateway, Role::engineer});
  router.add({Method::get, "/api/v1/campaigns", readers(), on(list)});
  router.add({Method::post, "/api/v1/campaigns", writers, on(create)});
  router.add({Method::get, "/api/v1/campaigns/{id}", readers(), [&l](const Request& request) {
                check_query(request, {});
                return whole(l, 200, named(l, request));
              }});
  router.add({Method::patch, "/api/v1/campaigns/{id}", writers, on(patch), 1 << 20, false, true});
  router.add(
      {Method::del, "/api/v1/campaigns/{id}", Access::any_of({Role::engineer}), [&l](const Request& request) {
         const auto campaign = named(l, request);
         value_or_problem(l.stores.campaigns.remove(campaign.id));
         l.services.audit(request, "campaign.delete " + to_string(campaign.id) + " " + campaign.name);
         Response response;
         response.status = 204;
         return response;
       }});
  router.add({Method::patch, "/api/v1/ranges", Access::any_of({Role::engineer}), on(label)});
  router.add({Method::get, "/api/v1/campaigns/{id}/samples", readers(), on(samples)});
  router.add({Method::get, "/api/v1/campaigns/{id}/samples/{sample}/cir", readers(), on(sample_cir)});
  router.add({Method::post, "/api/v1/campaigns/{id}/samples", writers, on(import), k_max_import_bytes});
}

}  // namespace anchord::api
