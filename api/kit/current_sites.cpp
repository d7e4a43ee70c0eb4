#include "api/kit/current_sites.hpp"

#include <utility>

namespace anchord::api {
namespace {

// Of the thread: what a handler calls, down to the stores, is asked for the same token, and a parameter that
// each of them hands on would be forgotten by one.
SiteSet& of_this_thread() {
  thread_local SiteSet sites;
  return sites;
}

}  // namespace

const SiteSet& current_sites() { return of_this_thread(); }

std::optional<SiteId> named_or_own(const std::optional<SiteId>& site) {
  const SiteSet& sites = current_sites();
  if (site || sites.all()) return site;
  const SiteList list = sites.sites();
  return list->size() == 1 ? std::optional(list->front()) : site;
}

ForSites::ForSites(SiteSet sites) : before_(std::exchange(of_this_thread(), std::move(sites))) {}
ForSites::~ForSites() { of_this_thread() = std::move(before_); }

}  // namespace anchord::api
