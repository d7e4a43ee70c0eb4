#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/ports/measurement_limits.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord {

/// What became of one row: the same identity with other content is a conflict, and the stored row stays.
enum class RowOutcome : std::uint8_t { accepted, duplicate, conflict, unknown_mission };

/// A radio heard in a mission, kept up to date by the appends.
struct DeviceSeen {
  enum class Kind : std::uint8_t { tag, anchor };
  NetworkId network_id{};
  Kind kind{Kind::anchor};
  MissionId mission{};
  UtcTime first_seen{}, last_seen{};  ///< measured times
  std::uint64_t n_ranges{};
};

inline constexpr auto k_radio_words =
    enum_table<DeviceSeen::Kind>({{"tag", DeviceSeen::Kind::tag}, {"anchor", DeviceSeen::Kind::anchor}});

/// Measurements. append_* return after the commit is on the disk (fsynced); concurrent calls share one
/// commit. Outcomes stand in the order of the rows. With `atomic`, one row that is a conflict or of an
/// unknown mission stores none of the call (the outcomes tell which; rows that would have been stored say
/// `accepted`, so look for a bad one). The same identity and content (arrival time aside) is a duplicate.
/// Callable from any thread; blocks. Errors of every port: storage_full, storage_unavailable, queue_full;
/// not_found and conflict as named.
class MeasurementStore {
 public:
  virtual ~MeasurementStore() = default;
  virtual Result<std::vector<RowOutcome>> append_ranges(std::vector<Range> rows, bool atomic) = 0;
  virtual Result<std::vector<RowOutcome>> append_fixes(std::vector<Fix> rows, bool atomic) = 0;

  /// Keyset page in order of (time, row id). `after` is the opaque cursor of the last page, empty at first.
  struct Filter {
    std::optional<MissionId> mission;
    std::optional<NetworkId> anchor, tag;
    std::optional<UtcTime> since, until;
    MeasurementLimits limits;  ///< of ranges
    std::optional<FixClass>
        fix;  ///< of ranges: of the newest position at most 2 s before it; none: there is no such
    std::size_t every{1};  ///< about one in n of those that match, by a hash of the id: for a picture of many
    std::size_t limit{100};
    std::string after;
    bool with_cir{false};
    bool descending{false};
  };
  template <class Row>
  struct Page {
    std::vector<Row> rows;
    std::vector<std::int64_t> ids;  ///< row ids, parallel to rows: the {id} of /ranges/{id}
    std::string next;               ///< empty at the end
  };
  /// Errors of a page or count: not_found where filter.mission is not there (any more): who reads page by
  /// page never takes the beginning of a flight deleted meanwhile for the whole.
  virtual Result<Page<Range>> ranges(const Filter& filter) = 0;
  virtual Result<Page<Fix>> fixes(const Filter& filter) = 0;
  virtual Result<Range> range(std::int64_t id) = 0;  ///< with CIR and truth
  virtual Result<std::uint64_t> count_ranges(const MissionId& mission) = 0;
  /// All that match, whatever `every`, `limit` and `after` say. Looks at each row of the mission.
  virtual Result<std::uint64_t> count_ranges(const Filter& filter) = 0;
  virtual Result<std::uint64_t> count_fixes(const MissionId& mission) = 0;
  /// All radios of one mission, or of all (one row per mission and device), newest first.
  virtual Result<std::vector<DeviceSeen>> devices(const std::optional<MissionId>& mission) = 0;
};

}  // namespace anchord
