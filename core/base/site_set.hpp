#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/locked.hpp"
#include "core/base/organization_id.hpp"

namespace anchord {

/// Some sites, in order and each once. Shared: a copy costs as much as a pointer.
using SiteList = std::shared_ptr<const std::vector<SiteId>>;

/// The sites of an organization as they are at the moment: one for each organization, shared by whoever is
/// bound to it, so that a site which comes in or goes out does so for all of them at once. Thread-safe; its
/// lock is the innermost.
class OrganizationSites {
 public:
  explicit OrganizationSites(const OrganizationId& id) : id_(id) {}
  const OrganizationId& id() const { return id_; }
  SiteList now() const { return sites_.copy(); }
  void set(SiteList sites) { sites_.exchange(std::move(sites)); }

 private:
  const OrganizationId id_;
  Locked<SiteList> sites_{std::make_shared<const std::vector<SiteId>>()};
};

/// Which sites somebody may see: all, and what has no site; only those named; or those that an organization
/// has when it is asked. A value, cheap to copy.
class SiteSet {
 public:
  /// All.
  SiteSet() = default;
  /// Only these; none of them: nothing.
  static SiteSet only(std::vector<SiteId> sites) {
    std::sort(sites.begin(), sites.end());
    sites.erase(std::unique(sites.begin(), sites.end()), sites.end());
    SiteSet set;
    set.sites_ = std::make_shared<const std::vector<SiteId>>(std::move(sites));
    return set;
  }
  /// Those of the organization, which change while the set is kept.
  static SiteSet of(std::shared_ptr<const OrganizationSites> organization) {
    SiteSet set;
    set.of_ = std::move(organization);
    return set;
  }

  bool all() const { return sites_ == nullptr && of_ == nullptr; }
  /// The rule of what a row of this site is to them; what has no site is of those who see all.
  bool holds(const std::optional<SiteId>& site) const {
    if (all()) return true;
    if (!site) return false;
    const SiteList list = sites();
    return std::binary_search(list->begin(), list->end(), *site);
  }
  /// As they are now, in order; null where it is all.
  SiteList sites() const { return of_ ? of_->now() : sites_; }
  /// Those of now, which stay.
  SiteSet as_of_now() const {
    SiteSet set;
    set.sites_ = sites();
    return set;
  }
  std::optional<OrganizationId> organization() const { return of_ ? std::optional(of_->id()) : std::nullopt; }

 private:
  SiteList sites_;
  std::shared_ptr<const OrganizationSites> of_;
};

}  // namespace anchord
