#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/ids.hpp"

namespace anchord {

/// Which sites somebody may see: all, and what has no site, or only those named and what is of them. A value,
/// cheap to copy.
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

  bool all() const { return sites_ == nullptr; }
  /// The rule of what a row of this site is to them; what has no site is of those who see all.
  bool holds(const std::optional<SiteId>& site) const {
    return all() || (site && std::binary_search(sites_->begin(), sites_->end(), *site));
  }
  /// In order; only of a set that is not all.
  const std::vector<SiteId>& sites() const { return *sites_; }

 private:
  std::shared_ptr<const std::vector<SiteId>> sites_;
};

}  // namespace anchord
