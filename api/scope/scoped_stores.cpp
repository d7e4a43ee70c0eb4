#include "api/scope/scoped_stores.hpp"

#include "api/scope/scoped.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/organization_store.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

Error elsewhere(std::string_view what) {
  return make_error(
      Errc::invalid_argument,
      std::string(what) + (current_sites().organization()
                               ? ": this token is bound to an organization: name one of its sites"
                               : ": this token is bound to sites: name one of them"));
}

struct ScopedStores::State {
  State(const Stores& all, OrganizationIndex& index)
      : sites(scoped_sites(all.sites, index)),
        plans(scoped_plans(all.plans)),
        frames(scoped_frames(all.frames)),
        places(scoped_places(all.places)),
        missions(scoped_missions(all.missions)),
        bin(scoped_bin(all.bin)),
        measurements(scoped_measurements(all.measurements, *missions)),
        anchors(scoped_anchors(all.anchors)),
        calibrations(scoped_calibrations(all.calibrations, *missions)),
        revisions(scoped_revisions(all.revisions, *anchors)),
        bundles(scoped_bundles(all, *missions, *calibrations, *places)),
        organizations(scoped_organizations(all.organizations, index)),
        stores{
            *measurements, *missions,     *bin,          all.exclusions, all.events,        all.procedure_log,
            *sites,        *anchors,      *calibrations, *revisions,     all.kits,          *frames,
            *plans,        all.campaigns, all.labels,    all.datasets,   all.training_runs, all.models,
            all.jobs,      all.tokens,    all.access,    all.service,    all.webhooks,      *places,
            *bundles,      *organizations} {}

  const std::unique_ptr<SiteStore> sites;
  const std::unique_ptr<PlanStore> plans;
  const std::unique_ptr<FrameStore> frames;
  const std::unique_ptr<PlaceStore> places;
  const std::unique_ptr<MissionStore> missions;
  const std::unique_ptr<MissionBin> bin;
  const std::unique_ptr<MeasurementStore> measurements;
  const std::unique_ptr<AnchorStore> anchors;
  const std::unique_ptr<CalibrationStore> calibrations;
  const std::unique_ptr<RevisionStore> revisions;
  const std::unique_ptr<BundleStore> bundles;
  const std::unique_ptr<OrganizationStore> organizations;
  const Stores stores;
};

ScopedStores::ScopedStores(const Stores& all, OrganizationIndex& index)
    : state_(std::make_unique<State>(all, index)) {}
ScopedStores::~ScopedStores() = default;

const Stores& ScopedStores::stores() const { return state_->stores; }

}  // namespace anchord::api
