#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/organization_id.hpp"
#include "core/base/time.hpp"
#include "core/types/document.hpp"
#include "core/types/estimate.hpp"
#include "core/types/geo_rings.hpp"

namespace anchord {

/// A place on earth with its own origin and outline.
struct Site {
  SiteId id{};
  std::optional<OrganizationId> organization{};  ///< of whose customers it is one
  std::string name;
  std::optional<Wgs84> origin{};  ///< of the ENU frame; absent: the first fixed position of its first mission
  GeoRings outline;               ///< of the building; empty: none
  std::string crs_frame;          ///< datum of the base, e.g. "ETRS89"; empty = unknown
  std::optional<double> crs_epoch{};
  std::optional<double> base_sigma_m{};  ///< of the base station's own coordinates
  std::string base_source;               ///< known_point, survey_in, network or empty
  std::optional<int> projected_epsg{};   ///< map system of `projected`, e.g. 25831
  UtcTime created{};
  std::uint64_t version{1};  ///< for ETag
};

/// Identity and facility-management data of one anchor; positions live in calibrations.
struct Anchor {
  AnchorId id{};
  NetworkId network_id{};
  std::optional<SiteId> site{};
  std::string name, building, floor, space, asset_tag, ifc_guid;
  std::vector<std::pair<std::string, std::string>> external_ids;  ///< system, id
  bool retired{false};
  UtcTime created{};
  std::uint64_t version{1};
};

/// Result of one batch solve over missions. Never changes once finished.
struct Calibration {
  CalibrationId id{};
  std::vector<MissionId> missions;
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Wgs84> origin{};  ///< of the ENU numbers
  Document settings;              ///< the request as accepted
  UtcTime created{};
  std::vector<Estimate> anchors;
  Document provenance{"{}"};  ///< profile, models, base, and what each flight said
  /// Residuals and the course of the estimate, for the report. Large: read back by AnchorStore::evidence
  /// alone.
  Document evidence;
};

/// A person published an anchor although a gate failed.
struct Override {
  NetworkId anchor{};
  std::string reason;  ///< never empty
  std::string by;      ///< token id
};

/// A published state of all anchors: what facility tools read.
struct Revision {
  std::uint64_t number{};
  CalibrationId calibration{};
  UtcTime published{};
  std::string by;  ///< token id
  std::string note;
};

}  // namespace anchord
