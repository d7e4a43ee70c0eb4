// Requests of tokens that are bound to sites: the one check by route, then the handler, which reads and
// writes as they may see.
#include "api/application_state.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/problem.hpp"
#include "api/kit/support.hpp"
#include "core/ports/mission_bin.hpp"

namespace anchord::api {

void Application::State::check_named(SiteRule rule, const Request& request) {
  switch (rule) {
    case SiteRule::refused:
      throw_problem(403, "forbidden", "this is of the whole server; the token is bound to sites");
    case SiteRule::own:
      if (!current_sites().organization())
        throw_problem(403, "forbidden", "this is of the whole server; the token is bound to sites");
      return;
    case SiteRule::open:
    case SiteRule::stored:
      return;
    case SiteRule::mission: {
      if (request.params.count("id") == 0) return;
      const auto id = path_id<MissionId>(request);
      const auto mission = missions.mission(id);
      if (!mission && !seen.bin.binned(id)) value_or_problem(mission);
      return;
    }
    case SiteRule::asked: {
      const auto id = query_mission(request);
      if (!id)
        throw_problem(422, "validation", "the token is bound to sites: name a mission of theirs",
                      {{"/mission", "required", "name a mission of the sites of the token"}});
      value_or_problem(missions.mission(*id));
      return;
    }
    case SiteRule::own_job: {
      if (request.params.count("id") == 0) return;
      const auto id = path_id<JobId>(request);
      if (!jobs.seen(id)) throw_problem(404, "not-found", "no job " + to_string(id));
      return;
    }
  }
}

Response Application::State::run_bound(const Route& route, const Request& request) {
  const SiteSet sites = request.principal.sites;
  const ForSites theirs(sites);
  check_named(site_rule(route.method, route.pattern), request);
  Response response = route.handler(request);
  if (response.body_stream) {
    response.body_stream = [sites, pull = std::move(response.body_stream)] {
      const ForSites still(sites);
      return pull();
    };
  }
  return response;
}

}  // namespace anchord::api
