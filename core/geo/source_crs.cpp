#include "core/geo/source_crs.hpp"

#include <proj.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/base/locked.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/network_datum.hpp"

namespace anchord {

namespace {

/// To which others are changed, whichever PROJ does with the smaller error.
constexpr std::array k_targets{4937, 4979};
/// Beyond the area of a system its numbers are those of another zone, or easting for northing.
constexpr double k_area_margin_deg = 1.5;
constexpr double k_convergence_step_m = 10;

}  // namespace

/// Owns what PROJ made.
struct ProjHandle {
  PJ* pj{nullptr};
  explicit ProjHandle(PJ* made = nullptr) : pj(made) {}
  ~ProjHandle() {
    if (pj != nullptr) proj_destroy(pj);
  }
  ProjHandle(const ProjHandle&) = delete;
  ProjHandle& operator=(const ProjHandle&) = delete;
  ProjHandle(ProjHandle&& other) noexcept : pj(std::exchange(other.pj, nullptr)) {}
  ProjHandle& operator=(ProjHandle&& other) noexcept {
    std::swap(pj, other.pj);
    return *this;
  }
};

struct SourceCrs::Operations {
  Operations() : context(proj_context_create()) {
    proj_context_set_enable_network(context, 0);
    // PROJ prints what it cannot do; we say it in our own words.
    proj_log_level(context, PJ_LOG_NONE);
  }
  ~Operations() {
    horizontal = ProjHandle();
    vertical = ProjHandle();
    proj_context_destroy(context);
  }
  Operations(const Operations&) = delete;
  Operations& operator=(const Operations&) = delete;
  PJ_CONTEXT* context;
  ProjHandle horizontal, vertical;
};

namespace {

std::string epsg_text(int epsg) { return "EPSG:" + std::to_string(epsg); }

std::string name_of(const PJ* pj) {
  const char* name = pj != nullptr ? proj_get_name(pj) : nullptr;
  return name != nullptr ? name : "";
}

std::string upper(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c != ' ' && c != '_') out += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  }
  return out;
}

std::optional<int> whole(std::string_view text) {
  int value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || fault != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// EPSG code of what a person writes.
std::optional<int> epsg_of(std::string_view written) {
  const std::string text = upper(written);
  if (text == "ECEF") return 4978;
  std::string_view rest = text;
  if (rest.starts_with("EPSG:")) return whole(rest.substr(5));
  if (rest.starts_with("UTM")) {
    rest.remove_prefix(3);
    if (rest.starts_with("ZONE")) rest.remove_prefix(4);
    if (rest.empty() || (rest.back() != 'N' && rest.back() != 'S')) return std::nullopt;
    const auto zone = whole(rest.substr(0, rest.size() - 1));
    if (!zone || *zone < 1 || *zone > 60) return std::nullopt;
    return (rest.back() == 'N' ? 32600 : 32700) + *zone;
  }
  return whole(rest);
}

/// The one operation that PROJ takes at this place, longitude and easting first; null where there is none.
ProjHandle operation_at(PJ_CONTEXT* context, const PJ* from, const PJ* to, const PJ_COORD& at) {
  const char* const options[] = {"ALLOW_BALLPARK=NO", nullptr};
  const ProjHandle found{proj_create_crs_to_crs_from_pj(context, from, to, nullptr, options)};
  if (found.pj == nullptr) return ProjHandle();
  ProjHandle all{proj_normalize_for_visualization(context, found.pj)};
  if (all.pj == nullptr) return ProjHandle();
  const PJ_COORD out = proj_trans(all.pj, PJ_FWD, at);
  if (!std::isfinite(out.xyz.x) || !std::isfinite(out.xyz.y)) {
    proj_errno_reset(all.pj);
    return all;  // the caller finds the place outside
  }
  ProjHandle used{proj_trans_get_last_used_operation(all.pj)};
  return used.pj != nullptr ? std::move(used) : std::move(all);
}

Result<void> check_area(PJ_CONTEXT* context, const PJ* crs, const std::string& shown, const Wgs84& place) {
  double west = -180, south = -90, east = 180, north = 90;
  proj_get_area_of_use(context, crs, &west, &south, &east, &north, nullptr);
  const bool east_of_west = place.lon_deg >= west - k_area_margin_deg,
             west_of_east = place.lon_deg <= east + k_area_margin_deg;
  // An area over the date line has its western limit east of its eastern one.
  const bool within = west <= east ? east_of_west && west_of_east : east_of_west || west_of_east;
  if (within && place.lat_deg >= south - k_area_margin_deg && place.lat_deg <= north + k_area_margin_deg)
    return boost::outcome_v2::success();
  char text[200];
  std::snprintf(
      text, sizeof text,
      "the first position would be at latitude %.4f, longitude %.4f, outside latitudes %.1f to %.1f, "
      "longitudes %.1f to %.1f of ",
      place.lat_deg, place.lon_deg, south, north, west, east);
  return make_error(Errc::invalid_argument,
                    text + shown + ": is it another system or zone, or are easting and northing exchanged?");
}

std::string metres(double value_m) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g m", value_m);
  return text;
}

}  // namespace

SourceCrs::SourceCrs() : operations_(std::make_unique<Locked<Operations>>()) {}
SourceCrs::SourceCrs(SourceCrs&&) noexcept = default;
SourceCrs& SourceCrs::operator=(SourceCrs&&) noexcept = default;
SourceCrs::~SourceCrs() = default;

Result<void> read_heights(std::string_view text, SourceCrsSpec& spec) {
  spec.height_epsg.reset();
  spec.separation_m.reset();
  const std::string word = upper(text);
  if (word == "ELLIPSOIDAL") return boost::outcome_v2::success();
  if (word.starts_with("EPSG:")) {
    spec.height_epsg = whole(std::string_view(word).substr(5));
    if (spec.height_epsg) return boost::outcome_v2::success();
  }
  double value = 0;
  const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (fault == std::errc{} && end == word.data() + word.size() && std::abs(value) <= 200) {
    spec.separation_m = value;
    return boost::outcome_v2::success();
  }
  return make_error(
      Errc::invalid_argument,
      "heights '" + std::string(text) +
          "': give ellipsoidal, the EPSG code of a vertical system (EPSG:5773 is EGM96, mean sea "
          "level of most receivers), or the height of the geoid there in metres (-200 to 200)");
}

/// Of a system's own datum where networks give it, else of the one with the smallest error of the change.
Result<void> SourceCrs::find_horizontal(Operations& of, PJ* crs, const SourceCrsSpec& spec,
                                        const Eigen::Vector3d& first) {
  const ProjHandle base{proj_crs_get_geodetic_crs(of.context, crs)};
  double best_m = HUGE_VAL;
  const auto consider = [&](int target) {
    const ProjHandle to{proj_create(of.context, epsg_text(target).c_str())};
    if (to.pj == nullptr) return;
    ProjHandle found =
        operation_at(of.context, crs, to.pj, proj_coord(first.x(), first.y(), first.z(), HUGE_VAL));
    const double error_m =
        found.pj != nullptr ? proj_coordoperation_get_accuracy(of.context, found.pj) : HUGE_VAL;
    if (!(error_m >= 0) || error_m >= best_m) return;
    best_m = error_m;
    datum_ = name_of(to.pj);
    of.horizontal = std::move(found);
  };
  for (const auto& own : k_network_datums) {
    const ProjHandle flat{proj_create(of.context, epsg_text(own.flat_epsg).c_str())};
    if (base.pj != nullptr && flat.pj != nullptr &&
        proj_is_equivalent_to_with_ctx(of.context, base.pj, flat.pj,
                                       PJ_COMP_EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS) != 0)
      consider(own.full_epsg);
  }
  for (const int target : k_targets) {
    if (of.horizontal.pj == nullptr || best_m > 0) consider(target);
  }
  if (of.horizontal.pj == nullptr)
    return make_error(Errc::unsupported, "no transformation from " + name_ +
                                             " to ETRS89 or WGS84 at the first position with the grids "
                                             "installed, or the position lies outside the system");
  datum_error_m_ = best_m;
  if (best_m <= spec.max_datum_error_m) return boost::outcome_v2::success();
  return make_error(
      Errc::unsupported,
      "with the grids installed the change of datum from " + name_ + " to " + datum_ + " has an error of " +
          metres(best_m) + " (limit " + metres(spec.max_datum_error_m) +
          "): install the grid of that country for PROJ, export longitude and latitude instead, "
          "or accept the error");
}

Result<void> SourceCrs::find_vertical(Operations& of, const SourceCrsSpec& spec,
                                      const Eigen::Vector3d& first) {
  heights_ = "above the ellipsoid";
  if (spec.separation_m)
    heights_ += ", computed from heights above a geoid " + metres(*spec.separation_m) + " above it";
  if (!spec.height_epsg) return boost::outcome_v2::success();
  const ProjHandle vertical{proj_create(of.context, epsg_text(*spec.height_epsg).c_str())};
  if (vertical.pj == nullptr)
    return make_error(Errc::not_found, "PROJ does not know " + epsg_text(*spec.height_epsg));
  const std::string name = name_of(vertical.pj);
  if (proj_get_type(vertical.pj) != PJ_TYPE_VERTICAL_CRS)
    return make_error(Errc::invalid_argument, epsg_text(*spec.height_epsg) + " (" + name +
                                                  ") is not a vertical system, such as EPSG:5773 (EGM96)");
  BOOST_OUTCOME_TRY(const Wgs84 flat, converted(of, first));
  for (const auto& [flat_epsg, full_epsg] : {std::pair{4326, 4979}, {4258, 4937}}) {
    const std::string both = epsg_text(flat_epsg) + "+" + std::to_string(*spec.height_epsg);
    const ProjHandle from{proj_create(of.context, both.c_str())},
        to{proj_create(of.context, epsg_text(full_epsg).c_str())};
    if (from.pj == nullptr || to.pj == nullptr) continue;
    of.vertical =
        operation_at(of.context, from.pj, to.pj, proj_coord(flat.lon_deg, flat.lat_deg, first.z(), HUGE_VAL));
    if (of.vertical.pj == nullptr) continue;
    const double error_m = proj_coordoperation_get_accuracy(of.context, of.vertical.pj);
    heights_ += ", computed from " + name + (error_m > 0 ? " (error " + metres(error_m) + ")" : "");
    return boost::outcome_v2::success();
  }
  return make_error(Errc::unsupported,
                    "no grid is installed to convert heights of " + name +
                        " to ellipsoidal heights: give the height of the geoid there in metres instead");
}

Result<void> SourceCrs::prepare(const SourceCrsSpec& spec, const Eigen::Vector3d& first) {
  const auto epsg = epsg_of(spec.crs);
  if (!epsg)
    return make_error(
        Errc::invalid_argument,
        "coordinate system '" + spec.crs + "': give an EPSG code (EPSG:25832), a zone (UTM 32N) or ECEF");
  separation_m_ = spec.separation_m;
  auto made = operations_->lock();
  PJ_CONTEXT* context = made->context;
  ProjHandle crs{proj_create(context, epsg_text(*epsg).c_str())};
  if (crs.pj == nullptr) return make_error(Errc::not_found, "PROJ does not know " + epsg_text(*epsg));
  name_ = name_of(crs.pj);
  const std::string shown = epsg_text(*epsg) + " (" + name_ + ")";
  const PJ_TYPE type = proj_get_type(crs.pj);
  projected_ = type == PJ_TYPE_PROJECTED_CRS;
  geocentric_ = type == PJ_TYPE_GEOCENTRIC_CRS;
  if (type == PJ_TYPE_COMPOUND_CRS)
    return make_error(Errc::invalid_argument,
                      shown +
                          " has heights too: give its horizontal system as the coordinate system and its "
                          "vertical system as that of the heights");
  if (!projected_ && !geocentric_ && type != PJ_TYPE_GEOGRAPHIC_2D_CRS && type != PJ_TYPE_GEOGRAPHIC_3D_CRS)
    return make_error(Errc::invalid_argument, shown + " is not a coordinate system of positions");
  // Heights go their own way.
  const auto own = std::ranges::find(k_network_datums, *epsg, &NetworkDatum::full_epsg);
  if (own != k_network_datums.end())
    crs = ProjHandle(proj_create(context, epsg_text(own->flat_epsg).c_str()));
  const ProjHandle conversion{projected_ ? proj_crs_get_coordoperation(context, crs.pj) : nullptr};
  const char* method = nullptr;
  if (conversion.pj != nullptr)
    proj_coordoperation_get_method_info(context, conversion.pj, &method, nullptr, nullptr);
  // PROJ computes this method without its rotation of 29.3", which is 745 m in EPSG:31300.
  if (method != nullptr && std::string_view(method).find("2SP Belgium") != std::string_view::npos)
    return make_error(Errc::unsupported, shown + " is not computed correctly by PROJ; use EPSG:31370");
  if (geocentric_) {
    if (spec.height_epsg || spec.separation_m)
      return make_error(Errc::invalid_argument,
                        "ECEF coordinates have no heights of their own: leave the heights ellipsoidal");
    datum_ = name_;
  } else {
    BOOST_OUTCOME_TRYV(find_horizontal(*made, crs.pj, spec, first));
  }
  BOOST_OUTCOME_TRYV(find_vertical(*made, spec, first));
  BOOST_OUTCOME_TRY(const Wgs84 place, converted(*made, first));
  return check_area(context, crs.pj, shown, place);
}

Result<SourceCrs> SourceCrs::open(const SourceCrsSpec& spec, const Eigen::Vector3d& first) {
  SourceCrs out;
  BOOST_OUTCOME_TRYV(out.prepare(spec, first));
  return out;
}

Result<Wgs84> SourceCrs::converted(Operations& operations, const Eigen::Vector3d& at) const {
  const auto outside = [&] { return make_error(Errc::invalid_argument, "the position is outside " + name_); };
  if (!at.allFinite()) return outside();
  if (geocentric_) {
    const Wgs84 place = wgs84_from_ecef(at);
    // Within 20 km of the surface: what else is no place of an aircraft.
    if (std::abs(place.height_m) > 20'000) return outside();
    return place;
  }
  // A change of datum moves what is 500 m up by a centimetre more than what is at 0.
  const double height_m = at.z() + separation_m_.value_or(0);
  const PJ_COORD flat =
      proj_trans(operations.horizontal.pj, PJ_FWD, proj_coord(at.x(), at.y(), height_m, HUGE_VAL));
  if (!std::isfinite(flat.xyz.x) || !std::isfinite(flat.xyz.y)) {
    proj_errno_reset(operations.horizontal.pj);
    return outside();
  }
  Wgs84 place{flat.xyz.y, flat.xyz.x, height_m};
  if (operations.vertical.pj == nullptr) return place;
  const PJ_COORD full =
      proj_trans(operations.vertical.pj, PJ_FWD, proj_coord(flat.xyz.x, flat.xyz.y, at.z(), HUGE_VAL));
  if (!std::isfinite(full.xyz.z)) {
    proj_errno_reset(operations.vertical.pj);
    return outside();
  }
  place.height_m = full.xyz.z;
  return place;
}

Result<Wgs84> SourceCrs::wgs84(const Eigen::Vector3d& at) const {
  auto use = operations_->lock();
  return converted(*use, at);
}

double SourceCrs::convergence_rad(const Eigen::Vector3d& at) const {
  if (!projected_) return 0;
  const auto here = wgs84(at), there = wgs84(at + Eigen::Vector3d(0, k_convergence_step_m, 0));
  if (!here || !there) return 0;
  const Eigen::Vector3d step_m = EnuFrame(here.value()).enu_from_wgs84(there.value()).m;
  return std::atan2(step_m.x(), step_m.y());
}

}  // namespace anchord
