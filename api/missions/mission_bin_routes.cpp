// Deleting a mission, and getting it back.
#include "core/ports/mission_bin.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/admin/housekeeping.hpp"
#include "api/admin/running_time.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/missions/mission_control.hpp"
#include "api/missions/mission_json.hpp"
#include "api/missions/mission_service.hpp"
#include "api/missions/routes.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

Ordered binned_json(MissionApi& s, const BinnedMission& one) {
  Ordered out = mission_json(one.mission, one.n_ranges, one.n_fixes);
  const std::int64_t left_ns = s.keep_deleted_ns - (s.running.now_ns() - one.deleted_ran_ns);
  out["deleted_at"] = to_rfc3339(one.deleted);
  out["deleted_by"] = one.deleted_by;
  out["kept_for_s"] = one.emptying ? 0 : std::max<std::int64_t>(0, left_ns / 1'000'000'000);
  out["emptying"] = one.emptying;
  return out;
}

std::string binned_etag(const BinnedMission& one) {
  return "\"b-" + std::to_string(one.deleted_ran_ns) + (one.emptying ? "-e\"" : "\"");
}

[[noreturn]] void gone(const BinnedMission& one) {
  throw_problem(410, "gone",
                one.mission.name + " was deleted at " + to_rfc3339(one.deleted) + " by " + one.deleted_by +
                    (one.emptying ? ", and its measurements are being removed"
                                  : ": restore it with POST /api/v1/missions/" + to_string(one.mission.id) +
                                        "/restore"));
}

Response empty_answer() {
  Response response;
  response.status = 204;
  return response;
}

/// For good, before its time; of what is in the bin already, so that nothing goes in one step.
Response purge(MissionApi& s, const Request& request, const MissionId& id) {
  if (!request.principal.has(Role::admin))
    throw_problem(403, "forbidden", "removing a mission permanently needs the role admin");
  const auto binned = s.bin.binned(id);
  if (!binned) {
    value_or_problem(s.missions.mission(id));
    throw_problem(409, "conflict", "this mission is not in the bin: delete it first, without purge");
  }
  require_match(request, binned_etag(binned.value()));
  value_or_problem(s.bin.empty(id));
  s.audit(request, "mission.purge " + to_string(id));
  s.housekeeping.wake();
  return empty_answer();
}

void refuse_in_use(MissionApi& s, const Mission& mission) {
  if (s.control.flies(mission.id))
    throw_problem(409, "conflict", mission.name + " is in the air: land and finish it, then delete it");
  if (mission.state == MissionState::recording)
    throw_problem(409, "conflict",
                  mission.name + R"( is recording: finish it first (POST actions {"action":"finish"}))");
}

Response remove(MissionApi& s, const Request& request) {
  check_query(request, {"purge"});
  const auto id = path_id<MissionId>(request);
  if (query_flag(request, "purge")) return purge(s, request, id);
  const Mission mission = named_mission(s, request);
  refuse_in_use(s, mission);
  require_match(request, etag_of(mission_answer(s, 200, mission)));
  if (!request.principal.has(Role::admin))
    require_control(s, request, id, std::string(request.header("anchord-lease")),
                    "deleting a mission needs the role admin, or control of it with its lease in the header "
                    "Anchord-Lease");
  value_or_problem(s.bin.put(id, s.clock.now(), s.running.now_ns(), request.principal.name));
  s.missions.forget(id);
  if (s.control.flies(id)) {  // it took off between the look and the deed
    value_or_problem(s.bin.restore(id));
    refuse_in_use(s, mission);
  }
  // Control of what is gone is nobody's: the aircraft is free for another flight at once.
  (void)s.control.release_control(id, std::string(request.header("anchord-lease")), request.principal)
      .has_value();
  s.audit(request, "mission.delete " + to_string(id));
  s.events.add(EventLevel::warning, "mission.deleted",
               mission.name + " was deleted by " + request.principal.name, id);
  return empty_answer();
}

Response restore(MissionApi& s, const Request& request) {
  check_query(request, {});
  const auto id = path_id<MissionId>(request);
  const auto body = json_body(request, true);
  std::vector<FieldError> errors;
  Fields(body, "", errors).finish();
  refuse_if_any(errors);
  const auto back = s.bin.restore(id);
  if (!back && back.error().code == Errc::not_found) {
    value_or_problem(s.missions.mission(id));  // 404 where none ever was
    throw_problem(409, "conflict", "this mission is not in the bin");
  }
  value_or_problem(back);
  s.missions.forget(id);
  const Mission mission = value_or_problem(s.missions.mission(id));
  s.audit(request, "mission.restore " + to_string(id));
  s.events.add(EventLevel::info, "mission.restored",
               mission.name + " was restored by " + request.principal.name, id);
  return mission_answer(s, 200, mission);
}

}  // namespace

/// The list of GET /missions?deleted=true.
Response binned_missions(MissionApi& s, const Request& request) {
  Ordered items = Ordered::array();
  for (const auto& one : value_or_problem(s.bin.list())) items.push_back(binned_json(s, one));
  return list_response(request, std::move(items), "");
}

/// GET /missions/{id}?deleted=true: one of the bin, with the ETag that a purge names.
Response binned_mission(MissionApi& s, const Request& request) {
  const auto one = value_or_problem(s.bin.binned(path_id<MissionId>(request)));
  Response response = json_response(200, binned_json(s, one));
  response.header("ETag", binned_etag(one));
  return response;
}

Mission named_mission(MissionApi& s, const Request& request) {
  const auto id = path_id<MissionId>(request);
  auto mission = s.missions.mission(id);
  if (!mission && mission.error().code == Errc::not_found) {
    if (const auto binned = s.bin.binned(id)) gone(binned.value());
  }
  return value_or_problem(std::move(mission));
}

void require_control(MissionApi& s, const Request& request, const MissionId& mission,
                     const std::string& lease, const std::string& what) {
  const auto held = s.control.renew_control(mission, lease, request.principal);
  if (!held) throw_problem(409, "no-control", what + ": " + held.error().message);
}

void add_mission_bin_routes(Router& router, MissionApi& s) {
  const auto op = Access::any_of({Role::op});
  router.add({Method::del, "/api/v1/missions/{id}", op,
              [&s](const Request& request) { return remove(s, request); }, 1 << 20, false, true});
  router.add({Method::post, "/api/v1/missions/{id}/restore", op,
              [&s](const Request& request) { return restore(s, request); }});
}

}  // namespace anchord::api
