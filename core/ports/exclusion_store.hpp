#pragma once

#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/exclusion.hpp"

namespace anchord {

/// Which measurements a person took out of use, and took back. Rows of their own: measurements are
/// append-only. Callable from any thread; errors as in measurement_store.hpp.
class ExclusionStore {
 public:
  virtual ~ExclusionStore() = default;
  /// With the rows it names: `row_ids`, which must be of the mission (not_found names the first that is not),
  /// or what its selection says; n_rows is counted. not_found: no such mission, or no row at all.
  virtual Result<Exclusion> insert(const Exclusion& exclusion, const std::vector<std::int64_t>& row_ids) = 0;
  /// Takes it back: as it is then. conflict when that was done already; not_found.
  virtual Result<Exclusion> include(const MissionId& mission, const ExclusionId& id,
                                    const Exclusion::Included& word) = 0;
  /// All of a mission, those taken back too, in order of making.
  virtual Result<std::vector<Exclusion>> exclusions(const MissionId& mission) = 0;
};

}  // namespace anchord
