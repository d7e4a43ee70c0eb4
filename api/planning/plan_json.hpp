#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/planning/local_plan.hpp"
#include "core/ports/plan_store.hpp"
#include "core/types/plan.hpp"

namespace anchord::api {

/// A plan as the wire has it: identity and revision, then the document.
nlohmann::ordered_json plan_json(const Plan& plan);
/// Body of POST and PUT, and the stored document: everything but identity and revision. Members that the
/// server gives (id, revision, created_at, changed_at, links) are read over, so that what was got can be sent
/// back.
Plan read_plan(const nlohmann::json& body, std::vector<FieldError>& errors);

StoredPlan stored(const Plan& plan);
/// One whose document this version cannot read (a newer server's, or spoiled by hand) has its identity and a
/// name that says so, and nothing to fly: it can be listed, replaced and deleted.
Plan plan_of(const StoredPlan& row);

nlohmann::ordered_json plan_check_json(const planning::PlanCheck& check);

}  // namespace anchord::api
