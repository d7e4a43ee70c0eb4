#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/base/site_set.hpp"
#include "core/ports/stores.hpp"

namespace anchord::api {

/// What is asked of organizations with every request and every element of a stream, without the disk: which
/// sites are theirs, and how often they may ask. Behind the stores (api/scope) by no more than the write that
/// is being answered: whoever wrote a site or a quota says so here before it answers. Thread-safe.
class OrganizationIndex {
 public:
  /// The stores of all sites, which outlive it.
  explicit OrganizationIndex(const Stores& stores) : stores_(stores) {}

  /// Reads all of them.
  Result<void> load();
  /// Its sites now and later; of one that is not known, none.
  std::shared_ptr<const OrganizationSites> sites_of(const OrganizationId& id);
  /// Of all its tokens together; nothing: no limit.
  std::optional<std::uint32_t> requests_per_minute(const OrganizationId& id) const;

  /// It was made, changed or removed.
  void site_changed(const SiteId& id);
  void limits_changed(const OrganizationId& id);

 private:
  struct Known {
    std::map<OrganizationId, std::shared_ptr<OrganizationSites>> sites;
    std::map<OrganizationId, std::uint32_t> requests_per_minute;
  };

  const Stores stores_;
  std::mutex rereading_;  // a row and what is noted of it: the newest read is the last that is noted
  Locked<Known> known_;
};

}  // namespace anchord::api
