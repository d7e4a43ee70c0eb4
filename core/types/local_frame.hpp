#pragma once

#include <optional>
#include <string>

#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/document.hpp"

namespace anchord {

/// The frame of a positioning system (Pozyx) in one building, tied to the globe by pairs.
struct LocalFrame {
  FrameId id{};
  std::string name;
  std::optional<SiteId> site{};
  Document definition{"{}"};  ///< pairs and their fit: api/anchors/frame_json
  UtcTime created{};
  std::uint64_t version{1};  ///< for ETag
};

/// One state of a kit's calibration.
struct StoredProfile {
  std::string kit;
  std::uint64_t version{};  ///< from 1; for ETag
  UtcTime time{};
  std::string by;      ///< token id, or empty for the server itself
  std::string source;  ///< "put", or "calibration <id>"
  Document profile;    ///< api/calibration/kit_profile_json
};

}  // namespace anchord
