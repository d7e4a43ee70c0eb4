// Sites, and what is drawn and planned at them.
#include <algorithm>
#include <map>

#include "api/kit/organization_index.hpp"
#include "api/scope/scoped.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {
namespace {

constexpr auto k_id_of = [](const auto& row) { return row.id; };
/// Of a row that names its site itself.
constexpr auto k_of_sites = [](const auto& row) -> Result<bool> { return current_sites().holds(row.site); };

class ScopedSites final : public SiteStore {
 public:
  ScopedSites(SiteStore& all, OrganizationIndex& index) : all_(all), index_(index) {}
  /// Who is bound to an organization makes sites of it.
  Result<void> insert(const Site& site) override {
    const auto own = current_sites().organization();
    if (!current_sites().all() && !(own && site.organization == own)) return elsewhere("a new site");
    BOOST_OUTCOME_TRYV(all_.insert(site));
    index_.site_changed(site.id);
    return boost::outcome_v2::success();
  }
  Result<void> update(const Site& site, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRY(const auto before, this->site(site.id));
      if (before.organization != site.organization) return elsewhere("/organization of the site");
    }
    BOOST_OUTCOME_TRYV(all_.update(site, expected_version));
    index_.site_changed(site.id);
    return boost::outcome_v2::success();
  }
  Result<Site> site(const SiteId& id) override {
    if (!current_sites().holds(id)) return absent("site", id);
    return all_.site(id);
  }
  Result<std::vector<Site>> sites(std::size_t limit, const std::optional<SiteId>& after,
                                  const std::optional<OrganizationId>& organization) override {
    if (current_sites().all()) return all_.sites(limit, after, organization);
    // Named by the token or its organization: read one by one, in the order of the list.
    std::vector<Site> out;
    const SiteList list = current_sites().sites();
    for (auto at = after ? std::upper_bound(list->begin(), list->end(), *after) : list->begin();
         at != list->end() && out.size() < limit; ++at) {
      auto found = all_.site(*at);
      BOOST_OUTCOME_TRY(const bool there, is_there(found));
      if (there && (!organization || found.value().organization == organization))
        out.push_back(std::move(found).value());
    }
    return out;
  }
  Result<void> remove(const SiteId& id, std::uint64_t expected_version) override {
    if (!current_sites().holds(id)) return absent("site", id);
    BOOST_OUTCOME_TRYV(all_.remove(id, expected_version));
    index_.site_changed(id);
    return boost::outcome_v2::success();
  }
  Result<SiteQuota> quota(const SiteId& id) override {
    if (!current_sites().holds(id)) return absent("site", id);
    return all_.quota(id);
  }
  Result<void> set_limits(const SiteId& id, const SiteLimits& limits) override {
    if (!current_sites().holds(id)) return absent("site", id);
    return all_.set_limits(id, limits);
  }

 private:
  SiteStore& all_;
  OrganizationIndex& index_;
};

class ScopedPlans final : public PlanStore {
 public:
  explicit ScopedPlans(PlanStore& all) : all_(all) {}
  Result<void> insert(const StoredPlan& plan) override {
    if (!current_sites().holds(plan.site)) return elsewhere("/site of the plan");
    return all_.insert(plan);
  }
  Result<void> update(const StoredPlan& plan, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->plan(plan.id));
      if (!current_sites().holds(plan.site)) return elsewhere("/site of the plan");
    }
    return all_.update(plan, expected_version);
  }
  Result<StoredPlan> plan(const PlanId& id) override {
    auto found = all_.plan(id);
    if (found && !current_sites().holds(found.value().site)) return absent("plan", id);
    return found;
  }
  Result<std::vector<StoredPlan>> plans(std::size_t limit, const std::optional<PlanId>& after) override {
    return seen_page<StoredPlan>(
        limit, after, [&](auto n, const auto& from) { return all_.plans(n, from); }, k_of_sites, k_id_of);
  }
  Result<void> remove(const PlanId& id, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(plan(id));
    }
    return all_.remove(id, expected_version);
  }
  // Of the flight service, for flights that were started by who may.
  Result<void> keep_procedure(const MissionId& mission, std::string_view state_json, UtcTime now) override {
    return all_.keep_procedure(mission, state_json, now);
  }
  Result<std::vector<std::pair<MissionId, std::string>>> procedures() override { return all_.procedures(); }
  Result<std::string> procedure(const MissionId& mission) override { return all_.procedure(mission); }

 private:
  PlanStore& all_;
};

class ScopedFrames final : public FrameStore {
 public:
  explicit ScopedFrames(FrameStore& all) : all_(all) {}
  Result<void> insert(const LocalFrame& frame) override {
    if (!current_sites().holds(frame.site)) return elsewhere("/site of the frame");
    return all_.insert(frame);
  }
  Result<void> update(const LocalFrame& frame, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->frame(frame.id));
      if (!current_sites().holds(frame.site)) return elsewhere("/site of the frame");
    }
    return all_.update(frame, expected_version);
  }
  Result<LocalFrame> frame(const FrameId& id) override { return seen(all_.frame(id)); }
  Result<LocalFrame> frame(const std::string& name) override { return seen(all_.frame(name)); }
  Result<std::vector<LocalFrame>> frames(std::size_t limit, const std::optional<FrameId>& after) override {
    return seen_page<LocalFrame>(
        limit, after, [&](auto n, const auto& from) { return all_.frames(n, from); }, k_of_sites, k_id_of);
  }
  Result<std::vector<LocalFrame>> frames_of(const SiteId& site) override {
    if (!current_sites().holds(site)) return std::vector<LocalFrame>{};
    return all_.frames_of(site);
  }
  Result<void> remove(const FrameId& id, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(frame(id));
    }
    return all_.remove(id, expected_version);
  }

 private:
  static Result<LocalFrame> seen(Result<LocalFrame> found) {
    if (found && !current_sites().holds(found.value().site))
      return make_error(Errc::not_found, "no such frame");
    return found;
  }
  FrameStore& all_;
};

class ScopedPlaces final : public PlaceStore {
 public:
  explicit ScopedPlaces(PlaceStore& all) : all_(all) {}
  Result<void> insert(const Building& building) override {
    if (!current_sites().holds(building.site)) return elsewhere("/site of the building");
    return all_.insert(building);
  }
  Result<void> update(const Building& building, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->building(building.id));
      if (!current_sites().holds(building.site)) return elsewhere("/site of the building");
    }
    return all_.update(building, expected_version);
  }
  Result<Building> building(const BuildingId& id) override {
    auto found = all_.building(id);
    if (found && !current_sites().holds(found.value().site)) return absent("building", id);
    return found;
  }
  Result<std::vector<Building>> buildings(std::size_t limit, const std::optional<BuildingId>& after,
                                          const std::optional<SiteId>& site) override {
    if (site && !current_sites().holds(site)) return std::vector<Building>{};
    return seen_page<Building>(
        limit, after, [&](auto n, const auto& from) { return all_.buildings(n, from, site); }, k_of_sites,
        k_id_of);
  }
  Result<void> remove(const BuildingId& id, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(building(id));
    }
    return all_.remove(id, expected_version);
  }

  Result<void> insert(const Floor& floor) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(building(floor.building));
    }
    return all_.insert(floor);
  }
  Result<void> update(const Floor& floor, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->floor(floor.id));
      BOOST_OUTCOME_TRYV(building(floor.building));
    }
    return all_.update(floor, expected_version);
  }
  Result<Floor> floor(const FloorId& id) override {
    auto found = all_.floor(id);
    if (!found || current_sites().all()) return found;
    BOOST_OUTCOME_TRY(const bool seen, is_there(building(found.value().building)));
    if (!seen) return absent("floor", id);
    return found;
  }
  Result<std::vector<Floor>> floors(std::size_t limit, const std::optional<FloorId>& after,
                                    const std::optional<BuildingId>& building) override {
    std::map<BuildingId, bool> seen;
    return seen_page<Floor>(
        limit, after, [&](auto n, const auto& from) { return all_.floors(n, from, building); },
        [&](const Floor& floor) -> Result<bool> {
          const auto [at, fresh] = seen.try_emplace(floor.building);
          if (fresh) {
            BOOST_OUTCOME_TRY(at->second, is_there(this->building(floor.building)));
          }
          return at->second;
        },
        k_id_of);
  }
  Result<void> remove(const FloorId& id, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(floor(id));
    }
    return all_.remove(id, expected_version);
  }

  Result<void> keep(const FloorId& floor, const StoredImage& image, std::string_view bytes) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->floor(floor));
    }
    return all_.keep(floor, image, bytes);
  }
  Result<void> keep(const FloorId& floor, const PlanTiles& tiles,
                    std::span<const PlanTile> pictures) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->floor(floor));
    }
    return all_.keep(floor, tiles, pictures);
  }
  // Their ids are in floors alone, which were read above.
  Result<std::string> bytes(const ImageId& image) override { return all_.bytes(image); }
  Result<std::optional<std::string>> tile(const PlanTilesId& tiles, int level, int column, int row) override {
    return all_.tile(tiles, level, column, row);
  }

 private:
  PlaceStore& all_;
};

}  // namespace

std::unique_ptr<SiteStore> scoped_sites(SiteStore& all, OrganizationIndex& index) {
  return std::make_unique<ScopedSites>(all, index);
}
std::unique_ptr<PlanStore> scoped_plans(PlanStore& all) { return std::make_unique<ScopedPlans>(all); }
std::unique_ptr<FrameStore> scoped_frames(FrameStore& all) { return std::make_unique<ScopedFrames>(all); }
std::unique_ptr<PlaceStore> scoped_places(PlaceStore& all) { return std::make_unique<ScopedPlaces>(all); }

}  // namespace anchord::api
