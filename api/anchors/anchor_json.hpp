#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/localize/accuracy_goal.hpp"
#include "core/types/anchor.hpp"
#include "core/types/estimate.hpp"
#include "core/types/mission.hpp"

namespace anchord {
struct PublishedPosition;
}

namespace anchord::api {

/// How good a place on the globe is that a fitted frame gave (frame_provenance).
struct GlobeAccuracy {
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};  ///< ENU axes
  double h95_m{}, v95_m{};
};
/// From the provenance of a calibration; nothing where no frame put the anchor on the globe, or its fit does
/// not tell how good it is.
std::optional<GlobeAccuracy> globe_accuracy(const nlohmann::ordered_json& provenance, NetworkId anchor);

/// What an anchor feature (api.md section 4) is made of.
struct AnchorFeature {
  Anchor anchor;
  std::string status;  ///< accepted, contradicted, or the live status
  struct Contradicted {
    CalibrationId by{};
    std::string json, text;  ///< the evidence, for programs and for people
  };
  std::optional<Contradicted> contradicted{};  ///< a later flight found it elsewhere
  std::optional<std::uint64_t> revision{};
  std::optional<UtcTime> calibrated{};
  std::optional<CalibrationId> calibration{};
  std::vector<MissionId> missions;
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Estimate> estimate{};
  std::optional<AnchorGoal> goal{};  ///< that its accuracy is held against
  std::optional<Site> site{};
  std::optional<Override> overridden{};
  std::optional<GlobeAccuracy> globe{};      ///< of a place a fitted frame gave
  std::string budget_json;                   ///< error budget; empty: none
  std::optional<Eigen::Vector3d> local_m{};  ///< in the positioning system's frame, where one is fitted
  struct Projected {
    int epsg{};
    double e_m{}, n_m{};
  };
  std::optional<Projected> projected{};
  std::string projected_reason;  ///< why there is none
  std::optional<double> height_orthometric_m{};
  std::string geoid;  ///< its name, or why there is none
};
/// The time that files of these anchors bear: that of making would make two files of the same differ. 1970 of
/// none.
UtcTime newest_calibration(std::span<const AnchorFeature> anchors);
/// Of the place the map shows: with the frame's fit where one gave it. For writers of one figure each.
std::optional<GlobeAccuracy> map_accuracy(const AnchorFeature& feature);
nlohmann::ordered_json anchor_feature_json(const AnchorFeature& feature);
/// No nested objects, for GIS readers.
nlohmann::ordered_json flat_feature_json(const AnchorFeature& feature);
/// Header and row of anchors.csv, without line end; safe to open in a spreadsheet.
std::string anchors_csv_header();
std::string anchor_csv_row(const AnchorFeature& feature);

/// Value, limit and words of one gate.
nlohmann::ordered_json gate_json(const Gate& gate);
/// position, accuracy, quality and mirror of one estimate, as in calibrations.
nlohmann::ordered_json estimate_result_json(const Estimate& estimate, TrackFrame frame,
                                            const std::optional<Site>& site = {},
                                            const std::optional<Override>& overridden = {},
                                            const std::optional<GlobeAccuracy>& globe = {});
nlohmann::ordered_json published_json(const PublishedPosition& position,
                                      const std::optional<GlobeAccuracy>& globe = {});

}  // namespace anchord::api
