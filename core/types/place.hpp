#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/document.hpp"

namespace anchord {

using BuildingId = Id<struct BuildingTag>;
using FloorId = Id<struct FloorTag>;
using ImageId = Id<struct ImageTag>;
using PlanTilesId = Id<struct PlanTilesTag>;

/// A building of a site, to which floors belong.
struct Building {
  BuildingId id{};
  SiteId site{};
  std::string name;
  std::optional<double> height_m{};  ///< of the roof above the ground
  UtcTime created{};
  std::uint64_t version{1};  ///< for ETag
};

enum class ImageKind : std::uint8_t {
  plan,      ///< the file as it was sent
  preview,   ///< the same, small enough to click on
  backdrop,  ///< turned north up, in metres
};
inline constexpr auto k_image_kind_words = enum_table<ImageKind>(
    {{"plan", ImageKind::plan}, {"preview", ImageKind::preview}, {"backdrop", ImageKind::backdrop}});

/// A picture that is kept in the database; its bytes are read apart.
struct StoredImage {
  ImageId id{};
  ImageKind kind{ImageKind::plan};
  std::string media_type;
  std::int64_t width_px{}, height_px{};
  std::int64_t bytes{};
  std::string sha256_hex;
};

/// A plan in square pictures, which are read apart: level 0 is all of it on one, each level above has half
/// the metres per pixel of the one below (core/floor_plan/tiles).
struct PlanTiles {
  PlanTilesId id{};
  int n_levels{};
  double m_per_px{};                     ///< of the last level
  std::int64_t width_px{}, height_px{};  ///< that the plan takes of the last level
  double west_m{}, north_m{};            ///< ENU of the georeference's origin: where all levels begin
  std::int64_t bytes{};
  std::string sha256_hex;
};

/// One of them. Columns count from the west, rows from the north.
struct PlanTile {
  int level{}, column{}, row{};
  std::string_view png;
};

/// A floor of a building with its plan. The documents belong to api/places.
struct Floor {
  FloorId id{};
  BuildingId building{};
  std::string name;
  double level{};                         ///< 0: ground; halves for mezzanines
  std::optional<double> base_height_m{};  ///< of its floor above the ground
  std::optional<StoredImage> plan{}, preview{}, backdrop{};
  std::optional<PlanTiles> tiles{};
  Document georeference;  ///< where the plan lies, and how that is known
  Document proposal;      ///< what tracing found, for a person to accept
  Document structure;     ///< outline and walls that a person accepted
  UtcTime created{};
  std::uint64_t version{1};  ///< for ETag
};

}  // namespace anchord
