#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "api/kit/seen_page.hpp"
#include "core/base/result.hpp"
#include "core/ports/stores.hpp"

namespace anchord::api {

// What the scoped stores share, and the makers of them.

class OrganizationIndex;

/// As the stores say that there is no such row.
template <class I>
Error absent(std::string_view what, const I& id) {
  return make_error(Errc::not_found, "no " + std::string(what) + " " + to_string(id));
}

/// Why something may not be written without a site, or with one that is not of the token's.
Error elsewhere(std::string_view what);

std::unique_ptr<SiteStore> scoped_sites(SiteStore& all, OrganizationIndex& index);
std::unique_ptr<OrganizationStore> scoped_organizations(OrganizationStore& all, OrganizationIndex& index);
std::unique_ptr<PlanStore> scoped_plans(PlanStore& all);
std::unique_ptr<FrameStore> scoped_frames(FrameStore& all);
std::unique_ptr<PlaceStore> scoped_places(PlaceStore& all);
std::unique_ptr<MissionStore> scoped_missions(MissionStore& all);
std::unique_ptr<MissionBin> scoped_bin(MissionBin& all);
/// missions: scoped.
std::unique_ptr<MeasurementStore> scoped_measurements(MeasurementStore& all, MissionStore& missions);
std::unique_ptr<AnchorStore> scoped_anchors(AnchorStore& all);
/// missions: scoped.
std::unique_ptr<CalibrationStore> scoped_calibrations(CalibrationStore& all, MissionStore& missions);
/// anchors: scoped.
std::unique_ptr<RevisionStore> scoped_revisions(RevisionStore& all, AnchorStore& anchors);
/// The others: scoped.
std::unique_ptr<BundleStore> scoped_bundles(const Stores& all, MissionStore& missions,
                                            CalibrationStore& calibrations, PlaceStore& places);

}  // namespace anchord::api
