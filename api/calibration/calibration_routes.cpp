#include <cmath>
#include <nlohmann/json.hpp>

#include "api/admin/job_answer.hpp"
#include "api/admin/job_service.hpp"
#include "api/anchors/anchor_json.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/calibration/calibration_json.hpp"
#include "api/calibration/calibration_report.hpp"
#include "api/calibration/calibration_service.hpp"
#include "api/calibration/position_diff.hpp"
#include "api/calibration/revision_news.hpp"
#include "api/calibration/routes.hpp"
#include "api/formats/evidence.hpp"
#include "api/formats/starnet.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/html_page.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/kit/support.hpp"
#include "api/missions/mission_service.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

/// Revisions that a calibration went into.
Ordered published_in(CalibrationApi& s, const CalibrationId& id) {
  Ordered out = Ordered::array();
  for (const auto& revision : value_or_problem(s.revisions.revisions(1000, 0))) {
    if (revision.calibration == id) out.push_back(revision.number);
  }
  return out;
}

void ask_whether_moved(CalibrationApi& s, Calibration& calibration);

Ordered whole(CalibrationApi& s, const Calibration& calibration) {
  Calibration today = calibration;
  ask_whether_moved(s, today);
  Ordered body = calibration_json(today, &s.goals);
  body["published"] = published_in(s, calibration.id);
  // Of what came with a bundle nobody knows.
  const auto job = s.jobs.wait(JobId{calibration.id.uuid}, std::chrono::milliseconds(0));
  body["worker"] = job && !job.value().worker.empty() ? Ordered(job.value().worker) : Ordered(nullptr);
  body["attempts"] = job ? job.value().attempts : 0;
  return body;
}

Response list(CalibrationApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<CalibrationId>(
      request,
      [&](std::size_t limit, const std::optional<CalibrationId>& after) {
        return s.calibration_store.calibrations(limit, after);
      },
      [](const Calibration& calibration) {
        Ordered item = calibration_json(calibration, nullptr);
        std::map<std::string, int> verdicts;
        for (const auto& estimate : calibration.anchors)
          ++verdicts[std::string(k_verdict_words.word(estimate.verdict))];
        item["n_anchors"] = calibration.anchors.size();
        item["verdicts"] = verdicts;
        return item;
      });
}

Response create(CalibrationApi& s, const Request& request) {
  std::vector<FieldError> errors;
  auto wanted = read_calibration_request(json_body(request), errors);
  for (std::size_t i = 0; i < wanted.learn_from.size(); ++i) {
    const auto mission = s.missions.mission(wanted.learn_from[i]);
    if (!mission && mission.error().code == Errc::not_found)
      errors.push_back({"/learn_from/" + std::to_string(i), "unknown_mission", "there is no such mission"});
  }
  for (std::size_t i = 0; i < wanted.missions.size(); ++i) {
    const auto mission = s.missions.mission(wanted.missions[i]);
    if (!mission && mission.error().code == Errc::not_found)
      errors.push_back({"/missions/" + std::to_string(i), "unknown_mission", "there is no such mission"});
  }
  refuse_if_any(errors);
  Job job = value_or_problem(s.calibrations.submit(std::move(wanted)));
  s.audit(request, "calibration.start " + to_string(job.id));
  return job_outcome(s.jobs, request, std::move(job), [&](const Job& done) {
    const auto calibration = value_or_problem(s.calibration_store.calibration(CalibrationId{done.id.uuid}));
    Response response = json_response(201, whole(s, calibration));
    response.header("Location", "/api/v1/calibrations/" + to_string(calibration.id));
    return response;
  });
}

/// What holds an anchor back: every gate that failed, a verdict that is not ok, or no gates at all.
std::vector<Gate> failures(const Estimate& estimate) {
  std::vector<Gate> out;
  if (estimate.verdict != Verdict::ok)
    out.push_back({"verdict", std::nullopt, 0, false,
                   std::string(k_verdict_words.word(estimate.verdict)) + ": " + estimate.reason});
  for (const auto& gate : estimate.gates) {
    if (!gate.passed) out.push_back(gate);
  }
  if (estimate.gates.empty())
    out.push_back({"gates", std::nullopt, 0, false, "this calibration was made without acceptance gates"});
  return out;
}

/// The answer to a publication of anchors that may not be accepted without a person: all of it, as gates.
[[noreturn]] void throw_gates(const std::map<NetworkId, std::vector<Gate>>& refused) {
  std::vector<FieldError> errors;
  Ordered gates = Ordered::array();
  for (const auto& [id, list] : refused) {
    for (const auto& gate : list) {
      errors.push_back({"/anchors", "gate", to_string(id) + " " + gate.name + ": " + gate.why});
      Ordered one = gate_json(gate);
      Ordered item{{"network_id", to_string(id)}};
      item.update(one);
      gates.push_back(std::move(item));
    }
  }
  Response response =
      problem(409, "conflict",
              std::to_string(refused.size()) +
                  " anchors fail a gate; to publish one of them, give an override with a reason for it",
              errors);
  auto body = Ordered::parse(response.body);
  body["gates"] = std::move(gates);
  response.body = to_wire(body);
  throw ProblemException{std::move(response)};
}

struct PublishRequest {
  std::string note;
  std::optional<std::vector<NetworkId>> anchors;  ///< absent: every acceptable one
  std::map<NetworkId, std::string> overrides;     ///< reason
};

PublishRequest read_publish(const nlohmann::json& body) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  PublishRequest out;
  out.note = fields.text("note", record_limits::k_note).value_or("");
  const auto reason = fields.text("reason", record_limits::k_reason).value_or("");
  const auto id_at = [&](const nlohmann::json& item, const std::string& at) -> std::optional<NetworkId> {
    const auto id = parse_network_id(item.is_string() ? item.get_ref<const std::string&>() : "");
    if (id) return id.value();
    errors.push_back({at, "bad_id", id.error().message});
    return std::nullopt;
  };
  if (const auto* list = fields.child("anchors")) {
    out.anchors.emplace();
    if (!list->is_array() || list->empty() || list->size() > 10'000)
      errors.push_back({"/anchors", "wrong_type", "must be an array of network ids"});
    else
      for (std::size_t i = 0; i < list->size(); ++i) {
        const auto id = id_at((*list)[i], "/anchors/" + std::to_string(i));
        if (!id) continue;
        out.anchors->push_back(*id);
        if (!reason.empty()) out.overrides[*id] = reason;  // one reason for all that are named
      }
  }
  if (const auto* list = fields.child("overrides")) {
    if (!list->is_array() || list->size() > 10'000)
      errors.push_back({"/overrides", "wrong_type", "must be an array of {network_id, reason}"});
    else
      for (std::size_t i = 0; i < list->size(); ++i) {
        const std::string at = "/overrides/" + std::to_string(i);
        Fields inner((*list)[i], at, errors);
        const auto text = inner.text("network_id", 20, true);
        const auto why = inner.text("reason", record_limits::k_reason, true);
        inner.finish();
        if (!text || !why) continue;
        if (why->empty()) errors.push_back({at + "/reason", "required", "an override needs a reason"});
        if (const auto id = id_at(*text, at + "/network_id")) out.overrides[*id] = *why;
      }
  }
  fields.finish();
  refuse_if_any(errors);
  return out;
}

/// The calibration as it stands today: against what was changed of its flights and its site since, and gate
/// "moved" against what is published now.
void ask_whether_moved(CalibrationApi& s, Calibration& calibration) {
  for (const auto& gate : {datum_gate(s, calibration), outdated_gate(s, calibration)}) {
    if (!gate) continue;
    for (auto& estimate : calibration.anchors) {
      std::erase_if(estimate.gates, [&](const Gate& g) { return g.name == gate->name; });
      estimate.gates.push_back(*gate);
    }
  }
  const auto before = placed(value_or_problem(s.revisions.published(std::nullopt)));
  const auto now = placed(calibration);
  for (const auto& change : changes(now, before)) {
    if (!change.gate) continue;
    for (auto& estimate : calibration.anchors) {
      if (estimate.anchor != change.anchor) continue;
      std::erase_if(estimate.gates, [](const Gate& g) { return g.name == "moved"; });
      estimate.gates.push_back(*change.gate);
    }
  }
}

/// Which anchors a publication takes and which of them only by a person's word.
std::vector<NetworkId> chosen(const Calibration& calibration, const PublishRequest& wanted,
                              std::vector<Override>& overrides, const std::string& by) {
  std::vector<NetworkId> out;
  std::map<NetworkId, std::vector<Gate>> refused;
  std::vector<FieldError> errors;
  std::map<NetworkId, const Estimate*> known;
  for (const auto& estimate : calibration.anchors) {
    if (estimate.best) known[estimate.anchor] = &estimate;
  }
  const auto take = [&](const Estimate& estimate, bool asked_for) {
    if (estimate.acceptable()) return out.push_back(estimate.anchor);
    const auto reason = wanted.overrides.find(estimate.anchor);
    if (reason != wanted.overrides.end() && !reason->second.empty()) {
      overrides.push_back({estimate.anchor, reason->second, by});
      return out.push_back(estimate.anchor);
    }
    if (asked_for) refused[estimate.anchor] = failures(estimate);
  };
  for (const auto& [id, reason] : wanted.overrides) {
    if (known.count(id) == 0)
      errors.push_back({"/overrides", "no_position", "the calibration has no position of " + to_string(id)});
  }
  if (wanted.anchors) {
    for (std::size_t i = 0; i < wanted.anchors->size(); ++i) {
      const NetworkId id = (*wanted.anchors)[i];
      if (known.count(id) > 0)
        take(*known[id], true);
      else
        errors.push_back({"/anchors/" + std::to_string(i), "no_position",
                          "the calibration has no position of " + to_string(id)});
    }
  } else {
    for (const auto& [id, estimate] : known) take(*estimate, false);
  }
  refuse_if_any(errors);
  if (!refused.empty()) throw_gates(refused);
  if (out.empty()) {
    for (const auto& [id, estimate] : known) refused[id] = failures(*estimate);
    if (!refused.empty()) throw_gates(refused);
    throw_problem(409, "conflict", "no anchor of this calibration has a position");
  }
  return out;
}

/// Anchors that have no site come into that of the calibration; answers those of another one. Who is bound to
/// sites may publish none of another, and takes none that others published before it had a site.
std::vector<Anchor> claim_anchors(CalibrationApi& s, const Request& request, const Calibration& calibration,
                                  const std::vector<NetworkId>& anchors) {
  const SiteSet sites = current_sites();
  const auto flown = s.mission_store.mission(calibration.missions.front());
  if (!flown && sites.all()) return {};
  const auto site = value_or_problem(flown).site;
  if (!site && sites.all()) return {};
  // As they are for all: what is not seen is told from what nobody has.
  const ForSites all{SiteSet{}};
  std::vector<Anchor> free, elsewhere;
  std::vector<FieldError> errors;
  for (const auto& id : anchors) {
    auto anchor = value_or_problem(s.anchors.find_or_create(id, s.clock.now()));
    if (anchor.site && sites.holds(anchor.site)) {
      if (anchor.site != site) elsewhere.push_back(std::move(anchor));
    } else if (!anchor.site && (sites.all() || value_or_problem(s.revisions.history(id)).empty())) {
      free.push_back(std::move(anchor));
    } else {
      errors.push_back({"/anchors", "not_yours",
                        to_string(id) + " is no anchor of the sites that this token is bound to"});
    }
  }
  if (!errors.empty())
    throw_problem(409, "conflict",
                  std::to_string(errors.size()) +
                      " anchors are not of the sites of this token: publish the others by their network ids",
                  errors);
  for (auto& anchor : free) {
    anchor.site = site;
    value_or_problem(s.anchors.update(anchor, anchor.version));
    s.audit(request, "anchor.change " + to_string(anchor.network_id) + " site: " + to_string(*site));
  }
  return elsewhere;
}

Response publish(CalibrationApi& s, const Request& request) {
  auto calibration = value_or_problem(s.calibration_store.calibration(path_id<CalibrationId>(request)));
  const auto wanted = read_publish(json_body(request, true));
  // What is judged below is judged against this revision; the store refuses when another came in between.
  const auto newest = value_or_problem(s.revisions.revisions(1, 0));
  const std::uint64_t decided_on = newest.empty() ? 0 : newest.front().number;
  ask_whether_moved(s, calibration);
  std::vector<Override> overrides;
  const auto anchors = chosen(calibration, wanted, overrides, request.principal.token_id);
  const auto elsewhere = claim_anchors(s, request, calibration, anchors);
  // Audited before it happens: a publication that nobody can be asked about must not exist.
  s.audit(request, "calibration.publish " + to_string(calibration.id));
  for (const auto& one : overrides) {
    std::string words;
    for (const auto& estimate : calibration.anchors) {
      if (estimate.anchor != one.anchor) continue;
      for (const auto& gate : failures(estimate)) words += ' ' + gate.name + " (" + gate.why + ")";
    }
    s.audit(request, "calibration.override " + to_string(calibration.id) + ' ' + to_string(one.anchor) +
                         " reason: " + one.reason + "; failed:" + words);
  }
  const auto published = s.revisions.publish(calibration.id, anchors, request.principal.token_id, wanted.note,
                                             s.clock.now(), overrides, decided_on);
  if (!published)
    s.audit(request, "calibration.publish " + to_string(calibration.id),
            "refused: " + published.error().message);
  const auto revision = value_or_problem(published);
  for (const auto& id : anchors) value_or_problem(s.anchors.find_or_create(id, s.clock.now()));
  announce_revision(s, revision, anchors.size(), overrides.size());
  Ordered answer = revision_json(revision);
  Ordered taken = Ordered::array(), left = Ordered::array(), overridden = Ordered::array(),
          over = Ordered::array(), of_other_sites = Ordered::array();
  const auto flown = s.goals.flown(calibration.missions);
  for (const auto& id : anchors) taken.push_back(to_string(id));
  for (const auto& anchor : elsewhere)
    of_other_sites.push_back(
        {{"network_id", to_string(anchor.network_id)}, {"site", to_string(*anchor.site)}});
  for (const auto& one : overrides)
    overridden.push_back({{"network_id", to_string(one.anchor)}, {"reason", one.reason}});
  for (const auto& estimate : calibration.anchors) {
    if (std::find(anchors.begin(), anchors.end(), estimate.anchor) != anchors.end()) {
      if (const auto goal = s.goals.of(estimate.anchor, flown); !within(goal, estimate))
        over.push_back(
            {{"network_id", to_string(estimate.anchor)}, {"goal", anchor_goal_json(goal, estimate)}});
      continue;
    }
    Ordered gates = Ordered::array();
    for (const auto& gate : failures(estimate)) gates.push_back(gate_json(gate));
    left.push_back({{"network_id", to_string(estimate.anchor)},
                    {"verdict", k_verdict_words.word(estimate.verdict)},
                    {"reason", estimate.reason},
                    {"gates", std::move(gates)}});
  }
  answer["anchors"] = std::move(taken);
  answer["overrides"] = std::move(overridden);
  answer["left_out"] = std::move(left);
  answer["over_goal"] = std::move(over);
  answer["of_other_sites"] = std::move(of_other_sites);
  Response response = json_response(201, answer);
  response.header("Location", "/api/v1/anchors?revision=" + std::to_string(revision.number));
  return response;
}

/// One printable page, complete in itself.
Response report(CalibrationApi& s, const Request& request) {
  check_query(request, {});
  auto calibration = value_or_problem(s.calibration_store.calibration(path_id<CalibrationId>(request)));
  const auto page = value_or_problem(calibration_report(s, calibration));
  Response response = html_page(report_html(page));
  response.header("Content-Disposition",
                  "inline; filename=\"calibration-" + to_string(calibration.id).substr(28) + ".html\"");
  return response;
}

/// The same as input of STAR*NET.
Response starnet(CalibrationApi& s, const Calibration& calibration, const Evidence& evidence,
                 const std::optional<NetworkId>& wanted) {
  StarnetOptions options{s.program, {}, wanted};
  for (const auto& estimate : calibration.anchors) {
    if (const auto known = s.anchors.anchor(estimate.anchor))
      options.names[estimate.anchor] = known.value().name;
  }
  const auto listing = starnet_listing(calibration, evidence, options);
  if (!listing) throw_problem(422, "state", listing.error().message);
  Response response;
  response.body = listing.value();
  response.header("Content-Type", "text/plain; charset=utf-8");
  response.header("Content-Disposition",
                  "attachment; filename=\"calibration-" + to_string(calibration.id).substr(28) + ".dat\"");
  return response;
}

/// What each range says against the answer, as kept with the calibration; ?anchor= only those to one.
Response residuals(CalibrationApi& s, const Request& request) {
  check_query(request, {"anchor", "format"});
  const auto format = negotiate(request, {"json", "starnet"});
  const auto wanted = query_network_id(request, "anchor");
  const auto calibration = value_or_problem(s.calibration_store.calibration(path_id<CalibrationId>(request)));
  const auto text = value_or_problem(s.calibration_store.evidence(calibration.id));
  const auto evidence = text.empty() ? Evidence{} : value_or_problem(parse_evidence(text));
  if (format == "starnet") return starnet(s, calibration, evidence, wanted);
  const auto& flights = evidence.flights;
  Ordered items = Ordered::array();
  const auto number = [](double value) { return std::isfinite(value) ? Ordered(value) : Ordered(nullptr); };
  for (std::size_t i = 0; i < flights.size() && i < calibration.missions.size(); ++i) {
    const bool kept = flights[i].observations;
    for (const auto& [anchor, rows] : flights[i].residuals) {
      if (wanted && anchor != *wanted) continue;
      for (const auto& r : rows)
        items.push_back(
            {{"mission", to_string(calibration.missions[i])},
             {"network_id", to_string(anchor)},
             {"t_us", r.time.us()},
             {"distance_m", number(r.distance_m)},
             {"corrected_m", kept ? number(r.corrected_m) : Ordered(nullptr)},
             {"sigma_m", kept ? number(r.sigma_m) : Ordered(nullptr)},
             {"tag_m", kept ? Ordered{number(r.tag_m.x()), number(r.tag_m.y()), number(r.tag_m.z())}
                            : Ordered(nullptr)},
             {"residual_m", number(r.residual_m)},
             {"standardised", number(r.standardised)},
             {"weight", number(r.weight)}});
    }
  }
  return json_response(200, {{"items", std::move(items)}});
}

Response revisions(CalibrationApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  const auto page = page_query(request);
  std::uint64_t before = 0;
  if (!page.cursor.empty()) {
    nlohmann::json value;
    if (parse_json(page.cursor, value) || !value.is_number_unsigned())
      throw_problem(422, "validation", "cursor was not issued by this server",
                    {{"/cursor", "bad_cursor", "was not issued by this server"}});
    before = value.get<std::uint64_t>();
  }
  auto rows = value_or_problem(s.revisions.revisions(page.limit + 1, before));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& revision : rows) items.push_back(revision_json(revision));
  return list_response(request, std::move(items), more ? std::to_string(rows.back().number) : "");
}

}  // namespace

void add_calibration_routes(Router& router, CalibrationApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto engineer = Access::any_of({Role::engineer});
  router.add({Method::get, "/api/v1/calibrations", readers(), on(list)});
  router.add({Method::post, "/api/v1/calibrations", engineer, on(create)});
  router.add({Method::get, "/api/v1/calibrations/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return json_response(200, whole(s, value_or_problem(s.calibration_store.calibration(
                                                       path_id<CalibrationId>(request)))));
              }});
  router.add({Method::del, "/api/v1/calibrations/{id}", engineer, [&s](const Request& request) {
                const auto id = path_id<CalibrationId>(request);
                value_or_problem(s.calibration_store.remove(id));
                s.contradictions.changed();
                s.audit(request, "calibration.delete " + to_string(id));
                Response response;
                response.status = 204;
                return response;
              }});
  router.add(as_heavy({Method::get, "/api/v1/calibrations/{id}/report", readers(), on(report)}));
  router.add(as_heavy({Method::get, "/api/v1/calibrations/{id}/residuals", readers(), on(residuals)}));
  router.add({Method::post, "/api/v1/calibrations/{id}/publish", Access::any_of({Role::engineer, Role::op}),
              on(publish)});
  router.add({Method::get, "/api/v1/revisions", readers(), on(revisions)});
}

}  // namespace anchord::api
