#pragma once

#include <optional>

#include "core/base/site_set.hpp"

namespace anchord::api {

/// Which sites whoever this thread works for may see: those of the token while its request is answered, its
/// job runs or its answer is sent; else all.
const SiteSet& current_sites();

/// What is made without a site is of the site of a token that is bound to one alone.
std::optional<SiteId> named_or_own(const std::optional<SiteId>& site);

/// Works for them while it lives.
class ForSites {
 public:
  explicit ForSites(SiteSet sites);
  ~ForSites();
  ForSites(const ForSites&) = delete;
  ForSites& operator=(const ForSites&) = delete;

 private:
  SiteSet before_;
};

}  // namespace anchord::api
