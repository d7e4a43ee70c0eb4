#pragma once

#include <memory>

#include "core/ports/stores.hpp"

namespace anchord::api {

class OrganizationIndex;

/// The stores as whoever the thread works for may see them (api/kit/current_sites): rows of other sites are
/// not there. What is read by id is not_found, lists leave it out and their pages stay full, what is written
/// of or into another site is refused. For all sites, the same as the stores themselves. What has no site in
/// it (learning, devices, jobs, tokens, the audit log) is not told apart here: api/scope/route_sites refuses
/// its routes. Thread-safe as those below, which must outlive it.
class ScopedStores {
 public:
  /// index: which is kept as sites and quotas of organizations are written
  ScopedStores(const Stores& all, OrganizationIndex& index);
  ~ScopedStores();
  ScopedStores(const ScopedStores&) = delete;
  ScopedStores& operator=(const ScopedStores&) = delete;

  const Stores& stores() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::api
