#pragma once

#include <nlohmann/json_fwd.hpp>

#include "api/formats/report.hpp"
#include "core/types/anchor.hpp"
#include "core/types/mission.hpp"

namespace anchord::api {

struct CalibrationApi;

/// The page of a stored calibration: what was published of it (and over which gates), where the anchors are
/// in the house, and its evidence. errors: those of the stores
Result<Report> calibration_report(CalibrationApi& api, const Calibration& calibration);

/// A budget (budget_json) as the page shows it; of null none.
ReportBudget report_budget(const nlohmann::ordered_json& budget);

/// Facts and sentences that a stored and a freshly solved calibration tell alike.
void describe(Report& report, const std::vector<Mission>& missions, const std::string& settings_json);

}  // namespace anchord::api
