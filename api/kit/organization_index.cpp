#include "api/kit/organization_index.hpp"

#include <algorithm>
#include <vector>

#include "core/ports/organization_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_page = 500;

SiteList listed(std::vector<SiteId> sites) {
  return std::make_shared<const std::vector<SiteId>>(std::move(sites));
}

/// The same sites with this one among them, or without it; null where nothing changes.
SiteList changed(const SiteList& before, const SiteId& site, bool member) {
  const auto at = std::lower_bound(before->begin(), before->end(), site);
  const bool there = at != before->end() && *at == site;
  if (there == member) return nullptr;
  std::vector<SiteId> sites(before->begin(), at);
  if (member) sites.push_back(site);
  sites.insert(sites.end(), there ? at + 1 : at, before->end());
  return listed(std::move(sites));
}

}  // namespace

Result<void> OrganizationIndex::load() {
  const std::lock_guard one(rereading_);
  BOOST_OUTCOME_TRY(const auto members, stores_.organizations.members());
  std::map<OrganizationId, std::vector<SiteId>> sites;
  for (const auto& [organization, site] : members) sites[organization].push_back(site);
  std::map<OrganizationId, std::uint32_t> limits;
  std::optional<OrganizationId> after;
  for (bool more = true; more;) {
    BOOST_OUTCOME_TRY(const auto page, stores_.organizations.organizations(k_page, after));
    for (const auto& organization : page) {
      BOOST_OUTCOME_TRY(const auto stored, stores_.organizations.limits(organization.id));
      if (stored.requests_per_minute) limits[organization.id] = *stored.requests_per_minute;
      after = organization.id;
    }
    more = page.size() == k_page;
  }
  auto known = known_.lock();
  for (const auto& [id, of] : known->sites) of->set(listed(std::move(sites[id])));
  for (auto& [id, list] : sites) {
    auto& of = known->sites[id];
    if (of) continue;
    of = std::make_shared<OrganizationSites>(id);
    of->set(listed(std::move(list)));
  }
  known->requests_per_minute = std::move(limits);
  return boost::outcome_v2::success();
}

std::shared_ptr<const OrganizationSites> OrganizationIndex::sites_of(const OrganizationId& id) {
  auto known = known_.lock();
  auto& of = known->sites[id];
  if (!of) of = std::make_shared<OrganizationSites>(id);
  return of;
}

std::optional<std::uint32_t> OrganizationIndex::requests_per_minute(const OrganizationId& id) const {
  const auto known = known_.lock();
  const auto at = known->requests_per_minute.find(id);
  return at == known->requests_per_minute.end() ? std::nullopt : std::optional(at->second);
}

void OrganizationIndex::site_changed(const SiteId& id) {
  const std::lock_guard one(rereading_);
  // One that is gone, or that cannot be read, is of nobody: it is shown to too few rather than to too many.
  std::optional<OrganizationId> now;
  if (const auto site = stores_.sites.site(id)) now = site.value().organization;
  auto known = known_.lock();
  if (now && !known->sites.contains(*now)) known->sites[*now] = std::make_shared<OrganizationSites>(*now);
  for (const auto& [organization, of] : known->sites)
    if (auto list = changed(of->now(), id, organization == now)) of->set(std::move(list));
}

void OrganizationIndex::limits_changed(const OrganizationId& id) {
  const std::lock_guard one(rereading_);
  const auto stored = stores_.organizations.limits(id);
  auto known = known_.lock();
  if (stored && stored.value().requests_per_minute)
    known->requests_per_minute[id] = *stored.value().requests_per_minute;
  else
    known->requests_per_minute.erase(id);
}

}  // namespace anchord::api
