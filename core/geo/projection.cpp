#include "core/geo/projection.hpp"

#include <proj.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/base/locked.hpp"
#include "core/geo/network_datum.hpp"

namespace anchord {

namespace {

/// About a kilometre: degrees by 100, or metres by 1000.
using Cell = std::pair<double, double>;
Cell cell_of(PJ_DIRECTION direction, const PJ_COORD& at) {
  const double size = direction == PJ_FWD ? 0.01 : 1000;
  return {std::floor(at.xy.x / size), std::floor(at.xy.y / size)};
}

struct Transformation {
  Transformation() : context(proj_context_create()) {
    proj_context_set_enable_network(context, 0);
    // PROJ prints what it cannot do; we say it in our own words.
    proj_log_level(context, PJ_LOG_NONE);
  }
  ~Transformation() {
    if (operation != nullptr) proj_destroy(operation);
    proj_context_destroy(context);
  }
  Transformation(const Transformation&) = delete;
  Transformation& operator=(const Transformation&) = delete;
  PJ_CONTEXT* context;
  PJ* operation{nullptr};
  /// Where the change of datum was last found good, by direction: to ask PROJ takes a thousand times as long
  /// as to transform, and anchors of a site lie together.
  std::optional<Cell> good_forward{}, good_inverse{};
};

struct Owned {
  PJ* pj;
  ~Owned() {
    if (pj != nullptr) proj_destroy(pj);
  }
};

/// As of tracks (source_crs): beyond it map coordinates would be wrong by more than anchors are.
constexpr double k_max_datum_error_m = 0.5;
/// A frame that moves shows it between these years; plates move by up to 0.1 m a year.
constexpr std::array k_years{2010.0, 2030.0};
constexpr int k_wgs84_flat = 4326, k_wgs84_full = 4979, k_etrs89_full = 4937;
constexpr double k_max_unstated_move_m = 0.02, k_metres_a_degree = 111'195;

std::string code(int epsg) { return "EPSG:" + std::to_string(epsg); }

/// WGS 84 has been kept at the ITRF of its day since 2012, to 2 cm (G1674 at ITRF2008, G2139 at ITRF2014 as
/// IGb14, G2296 at ITRF2020; NGA.STND.0036). PROJ gives one error of 2 m for all that was ever called WGS 84.
bool is_wgs84_of_today(PJ_CONTEXT* context, const PJ* map, int geographic_epsg) {
  constexpr std::array k_today{7911, 7912, 9989, 9018};
  if (std::ranges::find(k_today, geographic_epsg) == k_today.end()) return false;
  const Owned base{proj_crs_get_geodetic_crs(context, map)},
      wgs84{proj_create(context, code(k_wgs84_flat).c_str())};
  return base.pj != nullptr && wgs84.pj != nullptr &&
         proj_is_equivalent_to_with_ctx(context, base.pj, wgs84.pj,
                                        PJ_COMP_EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS) != 0;
}

/// What keeps numbers of a map system from being metres east and north; empty where they are. Both axes of a
/// polar system point north, or both south.
std::string not_metres_east_north(PJ_CONTEXT* context, const PJ* crs, const std::string& name) {
  const Owned axes{proj_crs_get_coordinate_system(context, crs)};
  std::array<std::string, 2> directions;
  for (int i = 0; i < 2; ++i) {
    const char *direction = nullptr, *unit = nullptr;
    double metres = 1;
    if (axes.pj == nullptr || proj_cs_get_axis_info(context, axes.pj, i, nullptr, nullptr, &direction,
                                                    &metres, &unit, nullptr, nullptr) == 0)
      return name + ": its axes are not supported";
    if (metres != 1) return name + " counts in " + unit + ": name a system that counts in metres";
    directions[static_cast<std::size_t>(i)] = direction;
  }
  std::ranges::sort(directions);
  if (directions == std::array<std::string, 2>{"east", "north"} ||
      (directions[0] == directions[1] && directions[0] != "west"))
    return {};
  return name + " counts " + directions[0] + " and " + directions[1] +
         ": name a system that counts east and north";
}

}  // namespace

/// A PJ belongs to one thread at a time.
struct Projection::Pipeline {
  Locked<Transformation> transformation;
  std::string unusable;  ///< why no easting and northing in metres comes of it
  std::string name;
  double epoch_year{HUGE_VAL};  ///< of the latitudes and longitudes; HUGE_VAL: not stated
  Result<PJ_COORD> transformed(PJ_DIRECTION direction, PJ_COORD from);
};

/// Errors of the change of datum are asked for at the place: grids and parameters have areas.
Result<PJ_COORD> Projection::Pipeline::transformed(PJ_DIRECTION direction, PJ_COORD from) {
  auto use = transformation.lock();
  const auto at = [&](double year) {
    from.xyzt.t = year;
    return proj_trans(use->operation, direction, from);
  };
  const PJ_COORD out = at(epoch_year);
  if (!std::isfinite(out.xy.x) || !std::isfinite(out.xy.y)) {
    proj_errno_reset(use->operation);
    return make_error(Errc::invalid_argument, "the position is outside " + name);
  }
  auto& good = direction == PJ_FWD ? use->good_forward : use->good_inverse;
  const Cell cell = cell_of(direction, from);
  if (good == cell) return out;
  const Owned taken{proj_trans_get_last_used_operation(use->operation)};
  const double error_m =
      proj_coordoperation_get_accuracy(use->context, taken.pj != nullptr ? taken.pj : use->operation);
  if (error_m > k_max_datum_error_m) {
    char text[60];
    std::snprintf(text, sizeof text, " has an error of %.2g m here (limit %.2g m)", error_m,
                  k_max_datum_error_m);
    return make_error(Errc::unsupported, "with the grids installed the change of datum to " + name + text +
                                             ": install the grid of that country for PROJ, or name the "
                                             "frame that the base station works in (crs.frame)");
  }
  const bool stated = epoch_year != HUGE_VAL;
  const PJ_COORD then = stated ? out : at(k_years[0]), later = stated ? out : at(k_years[1]);
  // Degrees one way, metres the other: what does not move is the same to the last digits in both.
  const double moved_m = std::hypot(later.xy.x - then.xy.x, later.xy.y - then.xy.y) *
                         (direction == PJ_FWD ? 1 : k_metres_a_degree);
  if (moved_m > k_max_unstated_move_m)
    return make_error(
        Errc::unsupported,
        "the frame of the base moves against " + name +
            ": state the epoch of its positions (crs.epoch of the site, a year such as 2026.5)");
  good = cell;
  return out;
}

std::optional<int> geographic_epsg(std::string_view datum) {
  std::string word;
  for (const char c : datum.substr(0, datum.find(" ("))) {
    if (c != ' ' && c != '-' && c != '_')
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  for (const auto& known : k_network_datums) {
    if (word == known.word) return known.full_epsg;
  }
  return std::nullopt;
}

std::optional<double> stated_epoch_year(std::string_view datum, const std::optional<double>& given) {
  if (given) return given;
  const auto open = datum.find(" (");
  if (open == std::string_view::npos) return std::nullopt;
  double year = 0;
  const auto [end, fault] = std::from_chars(datum.data() + open + 2, datum.data() + datum.size(), year);
  const bool whole = fault == std::errc{} && std::string_view(end, datum.data() + datum.size()) == ")";
  return whole && year >= 1900 && year <= 2200 ? std::optional(year) : std::nullopt;
}

Projection::Projection(int epsg, std::string name, std::unique_ptr<Pipeline> pipeline)
    : epsg_(epsg), name_(std::move(name)), pipeline_(std::move(pipeline)) {}
Projection::Projection(Projection&&) noexcept = default;
Projection& Projection::operator=(Projection&&) noexcept = default;
Projection::~Projection() = default;

Result<Projection> Projection::open(int epsg, int geographic_epsg, std::optional<double> epoch_year) {
  auto pipeline = std::make_unique<Pipeline>();
  auto made = pipeline->transformation.lock();
  PJ_CONTEXT* context = made->context;
  const Owned target{proj_create(context, code(epsg).c_str())};
  const Owned source{proj_create(context, code(geographic_epsg).c_str())};
  if (target.pj == nullptr) return make_error(Errc::not_found, "PROJ does not know " + code(epsg));
  if (source.pj == nullptr) return make_error(Errc::not_found, "PROJ does not know " + code(geographic_epsg));
  if (is_wgs84_of_today(context, target.pj, geographic_epsg)) return open(epsg, k_wgs84_full, epoch_year);
  const char* given = proj_get_name(target.pj);
  std::string name = given != nullptr ? given : code(epsg);
  if (proj_get_type(target.pj) != PJ_TYPE_PROJECTED_CRS)
    return make_error(Errc::invalid_argument, code(epsg) + " (" + name + ") is not a projected system");
  const Owned conversion{proj_crs_get_coordoperation(context, target.pj)};
  const char* method = nullptr;
  if (conversion.pj != nullptr)
    proj_coordoperation_get_method_info(context, conversion.pj, &method, nullptr, nullptr);
  // PROJ computes this method without its rotation of 29.3", which is 745 m in EPSG:31300.
  if (method != nullptr && std::string_view(method).find("2SP Belgium") != std::string_view::npos)
    return make_error(Errc::unsupported, name + " is not computed correctly by PROJ; use EPSG:31370");
  const char* const options[] = {"ALLOW_BALLPARK=NO", nullptr};
  const Owned found{proj_create_crs_to_crs_from_pj(context, source.pj, target.pj, nullptr, options)};
  if (found.pj == nullptr)
    return make_error(Errc::unsupported, "no transformation from " + code(geographic_epsg) + " to " + name +
                                             " with the grids installed");
  // Longitude and easting first, in whatever order the register has the axes.
  made->operation = proj_normalize_for_visualization(context, found.pj);
  if (made->operation == nullptr) return make_error(Errc::unsupported, name + ": its axes are not supported");
  pipeline->unusable = not_metres_east_north(context, target.pj, name);
  pipeline->name = name;
  if (epoch_year) pipeline->epoch_year = *epoch_year;
  return Projection(epsg, std::move(name), std::move(pipeline));
}

Result<Projection> Projection::open_own(int epsg) {
  const Transformation own;
  const Owned target{proj_create(own.context, code(epsg).c_str())};
  const Owned base{target.pj != nullptr ? proj_crs_get_geodetic_crs(own.context, target.pj) : nullptr};
  for (const auto& known : k_network_datums) {
    const Owned flat{proj_create(own.context, code(known.flat_epsg).c_str())};
    if (base.pj != nullptr && flat.pj != nullptr &&
        proj_is_equivalent_to_with_ctx(own.context, base.pj, flat.pj,
                                       PJ_COMP_EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS) != 0)
      return open(epsg, known.full_epsg);
  }
  auto opened = open(epsg, k_wgs84_full);
  return opened || opened.error().code != Errc::unsupported ? std::move(opened) : open(epsg, k_etrs89_full);
}

const std::string& Projection::unusable() const { return pipeline_->unusable; }

Result<Eigen::Vector2d> Projection::easting_northing_m(const Wgs84& at) const {
  if (!pipeline_->unusable.empty()) return make_error(Errc::unsupported, pipeline_->unusable);
  BOOST_OUTCOME_TRY(const PJ_COORD out, pipeline_->transformed(PJ_FWD, proj_coord(at.lon_deg, at.lat_deg,
                                                                                  at.height_m, HUGE_VAL)));
  return Eigen::Vector2d(out.xy.x, out.xy.y);
}

Result<Wgs84> Projection::geographic(const Eigen::Vector2d& easting_northing_m, double height_m) const {
  BOOST_OUTCOME_TRY(const PJ_COORD out,
                    pipeline_->transformed(PJ_INV, proj_coord(easting_northing_m.x(), easting_northing_m.y(),
                                                              height_m, HUGE_VAL)));
  return Wgs84{out.xy.y, out.xy.x, height_m};
}

}  // namespace anchord
