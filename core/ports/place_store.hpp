#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/place.hpp"

namespace anchord {

/// Buildings, floors and the pictures of their plans. Updates name the version they change, as those of
/// sites. Callable from any thread; errors as in measurement_store.hpp.
class PlaceStore {
 public:
  virtual ~PlaceStore() = default;
  virtual Result<void> insert(const Building& building) = 0;
  virtual Result<void> update(const Building& building, std::uint64_t expected_version) = 0;
  virtual Result<Building> building(const BuildingId& id) = 0;
  /// In id order.
  virtual Result<std::vector<Building>> buildings(std::size_t limit, const std::optional<BuildingId>& after,
                                                  const std::optional<SiteId>& site) = 0;
  /// conflict: it has floors.
  virtual Result<void> remove(const BuildingId& id, std::uint64_t expected_version) = 0;

  virtual Result<void> insert(const Floor& floor) = 0;
  /// Pictures that the floor no longer has are gone with it.
  virtual Result<void> update(const Floor& floor, std::uint64_t expected_version) = 0;
  virtual Result<Floor> floor(const FloorId& id) = 0;
  /// In id order.
  virtual Result<std::vector<Floor>> floors(std::size_t limit, const std::optional<FloorId>& after,
                                            const std::optional<BuildingId>& building) = 0;
  /// With its pictures.
  virtual Result<void> remove(const FloorId& id, std::uint64_t expected_version) = 0;

  /// Keeps a picture for a floor, in parts of 1 MiB, so that measurements are committed between them. It
  /// belongs to the floor once an update names it; what no update names goes with the floor's next one.
  virtual Result<void> keep(const FloorId& floor, const StoredImage& image, std::string_view bytes) = 0;
  virtual Result<std::string> bytes(const ImageId& image) = 0;

  /// The same for the tiles of a plan. Those that no floor has any more are deleted in parts too.
  virtual Result<void> keep(const FloorId& floor, const PlanTiles& tiles,
                            std::span<const PlanTile> pictures) = 0;
  /// The PNG of a tile; nothing where the plan has none there.
  virtual Result<std::optional<std::string>> tile(const PlanTilesId& tiles, int level, int column,
                                                  int row) = 0;
};

}  // namespace anchord
