#include "api/formats/plan_input.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "api/kit/reader.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using planning::NextPointInput;
using planning::NextPointOptions;

constexpr double k_max_m = 1e6;  // a site, not a continent
constexpr std::size_t k_max_points = 100'000;

/// Reads positions, remembering the number of dimensions they are written in.
class Reader {
 public:
  Reader(int dims, std::vector<FieldError>& errors) : dims_(dims), errors_(errors) {}

  std::optional<Eigen::Vector3d> point(const Json& value, const std::string& at) {
    const bool two = dims_ == 2 && value.is_array() && value.size() == 2;
    if (!two && !(value.is_array() && value.size() == 3)) {
      errors_.push_back(
          {at, "wrong_type",
           dims_ == 2 ? "must be [x, y] or [x, y, z] in metres" : "must be [x, y, z] in metres"});
      return std::nullopt;
    }
    Eigen::Vector3d out{0, 0, 0};
    for (std::size_t i = 0; i < value.size(); ++i) {
      const auto& element = value[i];
      if (!element.is_number() || !(std::abs(element.get<double>()) <= k_max_m)) {
        errors_.push_back({at + '/' + std::to_string(i), element.is_number() ? "out_of_range" : "wrong_type",
                           "must be a number of metres, at most 1e6 either way"});
        return std::nullopt;
      }
      out[static_cast<Eigen::Index>(i)] = element.get<double>();
    }
    return out;
  }

  std::vector<Eigen::Vector3d> points(Fields& fields, std::string_view key) {
    std::vector<Eigen::Vector3d> out;
    const Json* value = fields.child(key);
    if (value == nullptr) return out;
    if (!value->is_array() || value->size() > k_max_points) {
      fields.error(key, "wrong_type", "must be an array of at most 100000 points");
      return out;
    }
    for (std::size_t i = 0; i < value->size(); ++i) {
      if (const auto p = point((*value)[i], fields.pointer(key) + '/' + std::to_string(i))) out.push_back(*p);
    }
    return out;
  }

  std::optional<Eigen::Vector2d> corner(const Json& value, const std::string& at) {
    if (!value.is_array() || value.size() != 2) {
      errors_.push_back({at, "wrong_type", "must be [x, y] in metres"});
      return std::nullopt;
    }
    const auto p = Reader(2, errors_).point(value, at);
    if (!p) return std::nullopt;
    return p->head<2>().eval();
  }

  planning::Polygon polygon(const Json& value, const std::string& at) {
    planning::Polygon out;
    if (!value.is_array() || value.size() < 3 || value.size() > 10'000) {
      errors_.push_back({at, "wrong_type", "must be an array of 3 to 10000 corners [x, y]"});
      return out;
    }
    for (std::size_t i = 0; i < value.size(); ++i) {
      if (const auto c = corner(value[i], at + '/' + std::to_string(i))) out.push_back(*c);
    }
    return out;
  }

 private:
  int dims_;
  std::vector<FieldError>& errors_;
};

template <class T>
void take(T& out, const std::optional<T>& value) {
  if (value) out = *value;
}

void read_options(Fields& fields, NextPointOptions& options) {
  if (const auto rule = fields.word("rule", planning::k_rule_words)) {
    options.rule = *rule;
  }
  if (const auto combine = fields.word("combine", planning::k_combine_words)) {
    options.combine = *combine;
  }
  if (const auto m = fields.number("max_range_m", 0.1, k_max_m)) options.max_range_m = *m;
  take(options.visited_share, fields.number("visited_share", 0, 1));
  take(options.los_sigma_m, fields.number("los_sigma_m", 1e-4, 100));
  take(options.nlos_sigma_m, fields.number("nlos_sigma_m", 1e-4, 100));
  take(options.position_sigma_m, fields.number("position_sigma_m", 0, 100));
  take(options.prior_sigma_m, fields.number("prior_sigma_m", 1e-3, k_max_m));
  take(options.bias_column, fields.boolean("bias_column"));
  take(options.bias_sigma_m, fields.number("bias_sigma_m", 1e-4, 100));
  take(options.flight_time_cost, fields.boolean("flight_time_cost"));
  take(options.speed_mps, fields.number("speed_mps", 0.01, 100));
  take(options.dwell_s, fields.number("dwell_s", 0, 3600));
}

void read_grid(Fields& outer, std::vector<FieldError>& errors, planning::GridOptions& grid, int dims) {
  const Json* value = outer.child("grid");
  if (value == nullptr) return;
  Fields fields(*value, outer.pointer("grid"), errors);
  if (!fields.is_object()) return;
  take(grid.step_m, fields.number("step_m", 1e-3, 1000));
  grid.step_up_m = grid.step_m;
  take(grid.step_up_m, fields.number("step_up_m", 1e-3, 1000));
  if (const auto n = fields.integer("neighbourhood", 8, 26)) {
    if (*n != 8 && *n != 26) fields.error("neighbourhood", "unknown_value", "must be 8 (same height) or 26");
    if (*n == 26 && dims == 2) fields.error("neighbourhood", "out_of_range", "26 neighbours need dims 3");
    if (fields.has("reach") || fields.has("reach_up")) {
      fields.error("neighbourhood", "conflict", "give either neighbourhood or reach and reach_up");
    }
    grid.reach_up = *n == 26 ? 1 : 0;
  }
  if (const auto n = fields.integer("reach", 1, 200)) grid.reach = static_cast<int>(*n);
  if (const auto n = fields.integer("reach_up", 0, 200)) grid.reach_up = static_cast<int>(*n);
  fields.finish();
}

void read_bounds(Fields& fields, Reader& reader, std::vector<FieldError>& errors, planning::Bounds& bounds) {
  if (const Json* value = fields.child("fence_m"))
    bounds.fence = reader.polygon(*value, fields.pointer("fence_m"));
  if (const Json* value = fields.child("no_fly_m")) {
    if (!value->is_array()) fields.error("no_fly_m", "wrong_type", "must be an array of polygons");
    for (std::size_t i = 0; value->is_array() && i < value->size(); ++i) {
      bounds.no_fly.push_back(
          reader.polygon((*value)[i], fields.pointer("no_fly_m") + '/' + std::to_string(i)));
    }
  }
  if (const Json* value = fields.child("obstacles")) {
    if (!value->is_array()) fields.error("obstacles", "wrong_type", "must be an array of walls");
    for (std::size_t i = 0; value->is_array() && i < value->size(); ++i) {
      const std::string at = fields.pointer("obstacles") + '/' + std::to_string(i);
      Fields wall_fields((*value)[i], at, errors);
      if (!wall_fields.is_object()) continue;
      planning::Wall wall;
      const Json* ends = wall_fields.child("wall_m");
      if (ends == nullptr || !ends->is_array() || ends->size() != 2) {
        wall_fields.error("wall_m", ends == nullptr ? "required" : "wrong_type", "must be [[x, y], [x, y]]");
      } else {
        take(wall.a_m, reader.corner((*ends)[0], at + "/wall_m/0"));
        take(wall.b_m, reader.corner((*ends)[1], at + "/wall_m/1"));
      }
      take(wall.keep_out_m, wall_fields.number("keep_out_m", 0, 1000));
      take(wall.p_nlos, wall_fields.number("p_nlos", 0, 1));
      wall_fields.finish();
      bounds.walls.push_back(wall);
    }
  }
  take(bounds.keep_out_m, fields.number("keep_out_m", 0, 1000));
  bounds.min_height_m = fields.number("min_height_m", -k_max_m, k_max_m);
  bounds.max_height_m = fields.number("max_height_m", -k_max_m, k_max_m);
  if (bounds.min_height_m && bounds.max_height_m && *bounds.min_height_m > *bounds.max_height_m) {
    fields.error("max_height_m", "out_of_range", "is below min_height_m");
  }
}

void read_covariance(Fields& fields, planning::PlannedAnchor& anchor) {
  const auto c = fields.numbers("covariance_m2", 6, -1e12, 1e12);
  if (!c) return;
  Eigen::Matrix3d m;
  m << (*c)[0], (*c)[1], (*c)[2], (*c)[1], (*c)[3], (*c)[4], (*c)[2], (*c)[4], (*c)[5];
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(m, Eigen::EigenvaluesOnly);
  if (!(eigen.eigenvalues()[0] > 0)) {
    fields.error("covariance_m2", "out_of_range",
                 "is not a covariance (ee, en, eu, nn, nu, uu must be positive definite)");
    return;
  }
  anchor.covariance_m2 = m;
}

void read_measured_at(Fields& fields, std::size_t n_visited, planning::PlannedAnchor& anchor) {
  const Json* value = fields.child("measured_at");
  if (value == nullptr) {
    anchor.measured_at.resize(n_visited);
    std::iota(anchor.measured_at.begin(), anchor.measured_at.end(), std::size_t{0});
    return;
  }
  if (!value->is_array())
    return fields.error("measured_at", "wrong_type", "must be an array of indices of visited_m");
  for (std::size_t i = 0; i < value->size(); ++i) {
    const auto& index = (*value)[i];
    if (!index.is_number_unsigned() || index.get<std::uint64_t>() >= n_visited) {
      fields.error("measured_at", "out_of_range",
                   "index " + std::to_string(i) + " is not one of the " + std::to_string(n_visited) +
                       " visited points");
      return;
    }
    anchor.measured_at.push_back(index.get<std::size_t>());
  }
}

planning::PlannedAnchor read_anchor(const Json& value, const std::string& at, Reader& reader,
                                    std::size_t n_visited, std::vector<FieldError>& errors) {
  planning::PlannedAnchor anchor;
  Fields fields(value, at, errors);
  if (!fields.is_object()) return anchor;
  anchor.name = fields.text("name", 200).value_or(at.substr(at.rfind('/') + 1));
  const auto read_place = [&](Fields& place_fields, double probability) {
    const Json* position = place_fields.child("position_m");
    take(probability, place_fields.number("probability", 0, 1));
    if (position == nullptr)
      return place_fields.error("position_m", "required", "where the anchor is assumed to be");
    if (const auto p = reader.point(*position, place_fields.pointer("position_m"))) {
      anchor.places.push_back({*p, probability});
    }
  };
  read_place(fields, 1.0);
  if (const Json* mirror = fields.child("mirror")) {
    Fields mirror_fields(*mirror, fields.pointer("mirror"), errors);
    if (mirror_fields.is_object()) read_place(mirror_fields, 0.5);
    mirror_fields.finish();
  }
  double total = 0;
  for (const auto& place : anchor.places) total += place.probability;
  if (!anchor.places.empty() && !(total > 0))
    fields.error("probability", "out_of_range", "all places have probability 0");
  read_measured_at(fields, n_visited, anchor);
  read_covariance(fields, anchor);
  take(anchor.weight, fields.number("weight", 1e-6, 1e6));
  take(anchor.target_m, fields.number("target_m", 1e-4, 1000));
  fields.finish();
  return anchor;
}

}  // namespace

std::optional<PlanRequest> read_plan_input(std::string_view text, std::vector<FieldError>& errors) {
  Json json;
  if (const auto broken = parse_json(text, json)) {
    errors.push_back(*broken);
    return std::nullopt;
  }
  Fields fields(json, "", errors);
  if (!fields.is_object()) return std::nullopt;
  PlanRequest out;
  if (const auto dims = fields.integer("dims", 2, 3)) out.options.dims = static_cast<int>(*dims);
  Reader reader(out.options.dims, errors);
  out.input.visited = reader.points(fields, "visited_m");
  const std::size_t n_visited = fields.has("visited_m") && (*fields.child("visited_m")).is_array()
                                    ? fields.child("visited_m")->size()
                                    : 0;
  out.input.unreachable = reader.points(fields, "unreachable_m");
  if (const Json* current = fields.child("current_m"))
    out.input.current = reader.point(*current, "/current_m");
  if (n_visited == 0 && !fields.has("current_m")) {
    fields.error("visited_m", "required", "give visited points, or current_m");
  }
  read_options(fields, out.options);
  read_grid(fields, errors, out.options.grid, out.options.dims);
  read_bounds(fields, reader, errors, out.input.bounds);
  const Json* anchors = fields.child("anchors");
  if (anchors == nullptr || !anchors->is_array() || anchors->empty() || anchors->size() > 1000) {
    fields.error("anchors", anchors == nullptr ? "required" : "wrong_type",
                 "must be an array of 1 to 1000 anchors");
  } else {
    for (std::size_t i = 0; i < anchors->size(); ++i) {
      out.input.anchors.push_back(
          read_anchor((*anchors)[i], "/anchors/" + std::to_string(i), reader, n_visited, errors));
    }
  }
  fields.finish();
  if (!errors.empty()) return std::nullopt;
  return out;
}

}  // namespace anchord::api
