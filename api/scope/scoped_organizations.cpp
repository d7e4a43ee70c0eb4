// The organization that a token is bound to, and no other.
#include "api/kit/organization_index.hpp"
#include "api/scope/scoped.hpp"
#include "core/ports/organization_store.hpp"

namespace anchord::api {
namespace {

/// Written by tokens of the whole server alone.
class ScopedOrganizations final : public OrganizationStore {
 public:
  ScopedOrganizations(OrganizationStore& all, OrganizationIndex& index) : all_(all), index_(index) {}

  Result<void> insert(const Organization& organization) override {
    if (!current_sites().all()) return elsewhere("a new organization");
    return all_.insert(organization);
  }
  Result<void> update(const Organization& organization, std::uint64_t expected_version) override {
    if (!current_sites().all()) return absent("organization", organization.id);
    return all_.update(organization, expected_version);
  }
  Result<Organization> organization(const OrganizationId& id) override {
    if (!seen(id)) return absent("organization", id);
    return all_.organization(id);
  }
  Result<std::vector<Organization>> organizations(std::size_t limit,
                                                  const std::optional<OrganizationId>& after) override {
    if (current_sites().all()) return all_.organizations(limit, after);
    std::vector<Organization> out;
    const auto own = current_sites().organization();
    if (!own || limit == 0 || (after && *own <= *after)) return out;
    auto found = all_.organization(*own);
    BOOST_OUTCOME_TRY(const bool there, is_there(found));
    if (there) out.push_back(std::move(found).value());
    return out;
  }
  Result<void> remove(const OrganizationId& id, std::uint64_t expected_version) override {
    if (!current_sites().all()) return absent("organization", id);
    BOOST_OUTCOME_TRYV(all_.remove(id, expected_version));
    index_.limits_changed(id);
    return boost::outcome_v2::success();
  }
  Result<OrganizationQuota> quota(const OrganizationId& id) override {
    if (!seen(id)) return absent("organization", id);
    return all_.quota(id);
  }
  Result<OrganizationLimits> limits(const OrganizationId& id) override {
    if (!seen(id)) return absent("organization", id);
    return all_.limits(id);
  }
  Result<void> set_limits(const OrganizationId& id, const OrganizationLimits& limits) override {
    if (!current_sites().all()) return absent("organization", id);
    BOOST_OUTCOME_TRYV(all_.set_limits(id, limits));
    index_.limits_changed(id);
    return boost::outcome_v2::success();
  }
  Result<std::vector<std::pair<OrganizationId, SiteId>>> members() override {
    auto found = all_.members();
    if (found && !current_sites().all())
      std::erase_if(found.value(), [](const auto& row) { return !current_sites().holds(row.second); });
    return found;
  }

 private:
  static bool seen(const OrganizationId& id) {
    return current_sites().all() || current_sites().organization() == id;
  }
  OrganizationStore& all_;
  OrganizationIndex& index_;
};

}  // namespace

std::unique_ptr<OrganizationStore> scoped_organizations(OrganizationStore& all, OrganizationIndex& index) {
  return std::make_unique<ScopedOrganizations>(all, index);
}

}  // namespace anchord::api
