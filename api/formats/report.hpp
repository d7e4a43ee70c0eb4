#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "api/formats/evidence.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/types/anchor.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// What an anchor's uncertainty comes from, for people: source and share of the covariance's trace.
struct ReportBudget {
  std::vector<std::pair<std::string, double>> shares;
  std::string help;
};

struct ReportAnchor {
  Estimate estimate;
  std::string name;   ///< what people call it; the network id when empty
  std::string place;  ///< building, floor, space
  bool published{false};
  std::optional<Eigen::Vector3d> linear_m{}, wls_m{};  ///< by the dissertation's methods (eq 7.2, 7.10)
  ReportBudget budget{};                               ///< no shares: none known
  std::optional<Override> overridden{};
  std::optional<AnchorGoal> goal{};          ///< that its accuracy is held against; none: no server, no goal
  std::optional<Eigen::Vector3d> truth_m{};  ///< in the frame of the positions; height NaN when it has none
};

/// What one calibration's page is made of; strings are plain text, the page escapes them.
struct Report {
  std::string title{"Anchor calibration report"};
  std::string subtitle;     ///< site, building, flights
  std::string heading;      ///< "Revision 8", "not published"
  std::string calibration;  ///< id, or empty
  std::string program;      ///< "anchord 0.2.0"
  UtcTime created{};
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Wgs84> origin{};
  std::optional<Site> site{};
  std::vector<Eigen::Vector2d> outline_m;                  ///< of the building, east, north; open or closed
  std::vector<std::pair<std::string, std::string>> facts;  ///< label, value: provenance, in reading order
  std::vector<std::string> methods, remarks;               ///< sentences
  std::vector<ReportAnchor> anchors;
  Evidence evidence;
};

/// One HTML page, complete in itself: no script, no network, no font; A4 when printed. The same input gives
/// the same bytes.
std::string report_html(const Report& report);

/// Text as HTML: & < > " ' escaped, control characters dropped.
std::string html_text(std::string_view text);

}  // namespace anchord
