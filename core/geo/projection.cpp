#include "core/geo/projection.hpp"

#include <proj.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <utility>

#include "core/base/locked.hpp"

namespace anchord {

namespace {

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
};

struct Datum {
  std::string_view word;
  int epsg;
};
/// Geographic 3D systems of the EPSG registry; words without capitals, blanks and hyphens.
constexpr std::array k_datums{Datum{"wgs84", 4979},     Datum{"etrs89", 4937},      Datum{"etrf2000", 7931},
                              Datum{"itrf2008", 7911},  Datum{"itrf2014", 7912},    Datum{"itrf2020", 9989},
                              Datum{"igs14", 9018},     Datum{"nad83(2011)", 6319}, Datum{"gda94", 4939},
                              Datum{"gda2020", 7843},   Datum{"jgd2011", 6667},     Datum{"nzgd2000", 4959},
                              Datum{"sirgas2000", 4988}};

struct Owned {
  PJ* pj;
  ~Owned() {
    if (pj != nullptr) proj_destroy(pj);
  }
};

std::string code(int epsg) { return "EPSG:" + std::to_string(epsg); }

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
};

std::optional<int> geographic_epsg(std::string_view datum) {
  std::string word;
  for (const char c : datum.substr(0, datum.find(" ("))) {
    if (c != ' ' && c != '-' && c != '_')
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  for (const auto& known : k_datums) {
    if (word == known.word) return known.epsg;
  }
  return std::nullopt;
}

Projection::Projection(int epsg, std::string name, std::unique_ptr<Pipeline> pipeline)
    : epsg_(epsg), name_(std::move(name)), pipeline_(std::move(pipeline)) {}
Projection::Projection(Projection&&) noexcept = default;
Projection& Projection::operator=(Projection&&) noexcept = default;
Projection::~Projection() = default;

Result<Projection> Projection::open(int epsg, int geographic_epsg) {
  auto pipeline = std::make_unique<Pipeline>();
  auto made = pipeline->transformation.lock();
  PJ_CONTEXT* context = made->context;
  const Owned target{proj_create(context, code(epsg).c_str())};
  const Owned source{proj_create(context, code(geographic_epsg).c_str())};
  if (target.pj == nullptr) return make_error(Errc::not_found, "PROJ does not know " + code(epsg));
  if (source.pj == nullptr) return make_error(Errc::not_found, "PROJ does not know " + code(geographic_epsg));
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
  return Projection(epsg, std::move(name), std::move(pipeline));
}

const std::string& Projection::unusable() const { return pipeline_->unusable; }

Result<Eigen::Vector2d> Projection::easting_northing_m(const Wgs84& at) const {
  if (!pipeline_->unusable.empty()) return make_error(Errc::unsupported, pipeline_->unusable);
  const auto use = pipeline_->transformation.lock();
  const PJ_COORD out =
      proj_trans(use->operation, PJ_FWD, proj_coord(at.lon_deg, at.lat_deg, at.height_m, HUGE_VAL));
  if (!std::isfinite(out.xy.x) || !std::isfinite(out.xy.y)) {
    proj_errno_reset(use->operation);
    return make_error(Errc::invalid_argument, "the position is outside " + name_);
  }
  return Eigen::Vector2d(out.xy.x, out.xy.y);
}

Result<Wgs84> Projection::geographic(const Eigen::Vector2d& easting_northing_m, double height_m) const {
  const auto use = pipeline_->transformation.lock();
  const PJ_COORD out = proj_trans(
      use->operation, PJ_INV, proj_coord(easting_northing_m.x(), easting_northing_m.y(), height_m, HUGE_VAL));
  if (!std::isfinite(out.xy.x) || !std::isfinite(out.xy.y)) {
    proj_errno_reset(use->operation);
    return make_error(Errc::invalid_argument, "the position is outside " + name_);
  }
  return Wgs84{out.xy.y, out.xy.x, height_m};
}

}  // namespace anchord
