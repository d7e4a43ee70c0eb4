#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/anchor.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Position of one anchor in a published revision.
struct PublishedPosition {
  std::uint64_t since_revision{};  ///< the revision that set it; later ones carried it on
  CalibrationId calibration{};
  UtcTime published{};
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Wgs84> origin{};
  Estimate estimate{};
  std::optional<Override> overridden{};  ///< published in spite of a gate
};

/// Published positions of anchors: revisions, newest first, each whole.
class RevisionStore {
 public:
  virtual ~RevisionStore() = default;
  /// A new revision: the named anchors (each with a position in the calibration, else invalid_argument) take
  /// their position from it, all others keep that of the revision before. Which verdicts may be published is
  /// not decided here; `overrides` (of named anchors) are kept with the revision. conflict when every named
  /// anchor stands at its position of this calibration already, or when the newest revision is no longer
  /// `decided_on` (0: none), against which the caller decided.
  virtual Result<Revision> publish(const CalibrationId& id, const std::vector<NetworkId>& anchors,
                                   std::string_view by, std::string_view note, UtcTime now,
                                   const std::vector<Override>& overrides = {},
                                   std::optional<std::uint64_t> decided_on = std::nullopt) = 0;
  /// before: 0 for the newest page.
  virtual Result<std::vector<Revision>> revisions(std::size_t limit, std::uint64_t before) = 0;
  /// All positions of a revision, of the newest when absent (empty when nothing was ever published).
  virtual Result<std::vector<PublishedPosition>> published(std::optional<std::uint64_t> revision) = 0;
  /// That of one anchor in a revision, read by itself; none: it has no position in it, or there is no such
  /// revision.
  virtual Result<std::optional<PublishedPosition>> position(NetworkId network_id, std::uint64_t revision) = 0;
  /// Every position ever published of one anchor, newest first.
  virtual Result<std::vector<PublishedPosition>> history(NetworkId network_id) = 0;
  /// Another number after every change of what is stored, measurements apart: what was read under a number
  /// still holds under the same. None where that cannot be told (others write too).
  virtual std::optional<std::uint64_t> changes() const { return std::nullopt; }
};

}  // namespace anchord
