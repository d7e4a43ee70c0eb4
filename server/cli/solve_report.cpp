#include "server/cli/solve_report.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "api/calibration/calibration_report.hpp"
#include "api/formats/csv_table.hpp"
#include "api/formats/report.hpp"
#include "api/wire/budget_json.hpp"
#include "core/base/whole_file.hpp"
#include "core/geo/enu.hpp"

namespace anchord::cli {
namespace {

using Truth = std::map<std::string, Eigen::Vector3d>;

/// anchor_id with lat_deg, lon_deg and alt_m or h_m on the globe, x_m, y_m, z_m in a local frame; without a
/// height it is a truth in the plane (in a small area: 50 m of height would shift ENU by less than 1 mm).
Result<Truth> read_truth(const std::filesystem::path& file, const std::optional<Wgs84>& origin) {
  if (file.extension() != ".csv")
    return make_error(Errc::invalid_argument, file.string() + ": not a .csv file");
  BOOST_OUTCOME_TRY(auto table, CsvTable::open(file.parent_path().empty() ? "." : file.parent_path(),
                                               file.stem().string()));
  BOOST_OUTCOME_TRY(const auto id, table.require("anchor_id"));
  const std::array<const char*, 2> names =
      origin ? std::array<const char*, 2>{"lat_deg", "lon_deg"} : std::array<const char*, 2>{"x_m", "y_m"};
  BOOST_OUTCOME_TRY(const auto first, table.require(names[0]));
  BOOST_OUTCOME_TRY(const auto second, table.require(names[1]));
  const auto height = !origin                 ? table.column("z_m")
                      : table.column("alt_m") ? table.column("alt_m")
                                              : table.column("h_m");
  Truth truth;
  while (true) {
    BOOST_OUTCOME_TRY(const bool more, table.next());
    if (!more) return truth;
    Eigen::Vector3d at;
    BOOST_OUTCOME_TRY(at.x(), table.number(first));
    BOOST_OUTCOME_TRY(at.y(), table.number(second));
    BOOST_OUTCOME_TRY(const auto up, table.number(height));
    at.z() = up.value_or(0.0);
    if (!at.allFinite() || (origin && std::abs(at.x()) > 90)) return table.error("no place");
    Eigen::Vector3d place = origin ? EnuFrame(*origin).enu_from_wgs84({at.x(), at.y(), at.z()}).m : at;
    if (!up) place.z() = std::numeric_limits<double>::quiet_NaN();
    truth[std::string(table.text(id))] = place;
  }
}

}  // namespace

Result<void> write_solve_report(const FlightData& flight, const FlightSolution& solution,
                                const std::map<NetworkId, MethodAnswers>& methods,
                                const FlightOptions& options, const SolveReportOptions& wanted) {
  Truth truth;
  if (!wanted.truth.empty()) {
    BOOST_OUTCOME_TRY(truth, read_truth(wanted.truth, solution.origin));
  }
  Report report;
  report.subtitle = flight.mission.name;
  report.heading = "Not published";
  report.program = std::string("anchord ") + ANCHORD_VERSION;
  report.frame = flight.mission.frame;
  report.origin = solution.origin;
  report.evidence.flights.push_back(evidence_of(flight, solution, solution.origin));
  if (wanted.iterations > 0) {
    BOOST_OUTCOME_TRY(report.evidence.course, convergence_of(flight, options, wanted.iterations));
  }
  for (const auto& anchor : solution.anchors) {
    ReportAnchor one;
    one.estimate = anchor.estimate;
    one.name = anchor.name;
    if (anchor.budget) one.budget = api::report_budget(budget_json(*anchor.budget, false));
    if (const auto other = methods.find(anchor.estimate.anchor); other != methods.end()) {
      one.linear_m = other->second.linear_m;
      one.wls_m = other->second.wls_m;
    }
    const auto at = truth.find(anchor.name);
    if (at != truth.end()) one.truth_m = at->second;
    // The newest measurement dates the page, so that the same folder gives the same bytes.
    report.created = std::max(report.created, anchor.estimate.time);
    report.anchors.push_back(std::move(one));
  }
  report.facts = {
      {"Flight", flight.mission.name},
      {"Kit", flight.mission.kit.empty() ? "not named" : flight.mission.kit},
      {"Radio", flight.mission.radio.empty() ? "not named" : flight.mission.radio},
      {"Datum", flight.mission.frame == TrackFrame::wgs84 ? "of the base, not stated" : "local metres"}};
  api::describe(report, {flight.mission}, "{}");
  return write_whole(wanted.file, report_html(report));
}

}  // namespace anchord::cli
