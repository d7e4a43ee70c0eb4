#include "core/geo/geoid.hpp"

#include <GeographicLib/Geoid.hpp>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "core/base/locked.hpp"

namespace anchord {

/// GeographicLib's model keeps the last cell it read, so two threads must not ask at once.
struct Geoid::Model {
  Model(const std::string& name, const std::string& folder) : grid(std::in_place, name, folder) {}
  Locked<GeographicLib::Geoid> grid;
};

namespace {

struct Known {
  const char* file;
  const char* name;
};
/// Finest first.
constexpr std::array k_known{Known{"egm2008-1", "EGM2008"}, Known{"egm2008-2_5", "EGM2008"},
                             Known{"egm2008-5", "EGM2008"}, Known{"egm96-5", "EGM96"},
                             Known{"egm96-15", "EGM96"},    Known{"egm84-15", "EGM84"},
                             Known{"egm84-30", "EGM84"}};

}  // namespace

Geoid::Geoid(std::string name, std::unique_ptr<Model> model)
    : name_(std::move(name)), model_(std::move(model)) {}
Geoid::Geoid(Geoid&&) noexcept = default;
Geoid& Geoid::operator=(Geoid&&) noexcept = default;
Geoid::~Geoid() = default;

Result<Geoid> Geoid::open(const std::string& folder) {
  const std::string where = folder.empty() ? GeographicLib::Geoid::DefaultGeoidPath() : folder;
  for (const auto& known : k_known) {
    const auto file = std::filesystem::path(where) / (std::string(known.file) + ".pgm");
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored)) continue;
    try {  // the door of GeographicLib: it throws on a damaged file
      return Geoid(known.name, std::make_unique<Model>(known.file, where));
    } catch (const std::exception& fault) {
      return make_error(Errc::bad_frame, file.string() + ": " + fault.what());
    }
  }
  return make_error(Errc::not_found,
                    "no geoid file in " + where + " (geographiclib-get-geoids egm2008-5 installs one)");
}

Result<double> Geoid::undulation_m(const Wgs84& at) const {
  if (!std::isfinite(at.lon_deg) || !(std::abs(at.lat_deg) <= 90))
    return make_error(Errc::invalid_argument, "not a position on the globe");
  const auto grid = model_->grid.lock();
  try {
    return (*grid)(at.lat_deg, at.lon_deg);
  } catch (const std::exception& fault) {
    return make_error(Errc::storage_unavailable, fault.what());
  }
}

}  // namespace anchord
