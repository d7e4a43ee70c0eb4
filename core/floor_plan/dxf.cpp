#include "core/floor_plan/dxf.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "core/base/angle.hpp"
#include "core/base/text.hpp"

namespace anchord::floor_plan {
namespace {

using Eigen::Affine2d;
using Eigen::Vector2d;

constexpr std::string_view k_binary = "AutoCAD Binary DXF";
constexpr int k_max_depth = 16;                   ///< of blocks in blocks
constexpr std::size_t k_max_groups = 10'000'000;  ///< read, those of a block each time it is inserted
constexpr double k_step_rad = 5 * k_degree;
constexpr double k_largest = 1e10;  ///< coordinate in any unit

std::string_view trimmed(std::string_view text) {
  const auto from = text.find_first_not_of(" \t\r");
  if (from == std::string_view::npos) return {};
  return text.substr(from, text.find_last_not_of(" \t\r") - from + 1);
}

/// Code and value, a line each.
struct Group {
  int code{};
  std::string_view value;
};

class Groups {
 public:
  Groups(std::string_view text, std::size_t at) : text_(text), at_(at) {}
  std::size_t at() const { return at_; }
  /// Nothing at the end; what is half a group is an error.
  Result<std::optional<Group>> next() {
    const auto code = line();
    if (!code || (trimmed(*code).empty() && at_ >= text_.size())) return std::optional<Group>{};
    const auto value = line();
    Group out;
    const auto digits = trimmed(*code);
    const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), out.code);
    if (read.ec != std::errc{} || read.ptr != digits.data() + digits.size() || !value) return broken();
    out.value = trimmed(*value);
    return std::optional(out);
  }

 private:
  std::optional<std::string_view> line() {
    if (at_ >= text_.size()) return std::nullopt;
    const auto end = std::min(text_.find('\n', at_), text_.size());
    const auto out = text_.substr(at_, end - at_);
    at_ = end + 1;
    return out;
  }
  Error broken() const {
    const auto lines = std::count(
        text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, text_.size())), '\n');
    return make_error(Errc::bad_frame, "the DXF is broken or cut short near its line " +
                                           std::to_string(lines) + ": save it again as ASCII DXF");
  }
  std::string_view text_;
  std::size_t at_;
};

double number(std::string_view text) {
  double out = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), out);
  return read.ec == std::errc{} && std::isfinite(out) && std::abs(out) <= k_largest ? out : 0;
}

std::string_view text_of(std::span<const std::byte> bytes) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  return text;
}

/// One entity as its groups tell it.
struct Entity {
  std::string_view type, layer{"0"}, block;
  std::array<double, 80> value{};            ///< of the codes 10 to 79, the last one of each
  std::vector<Vector2d> points, fit_points;  ///< codes 10 and 20, 11 and 21
  std::vector<double> bulges;                ///< of the points
  bool shown{true};
  bool backwards{false};  ///< drawn on the other side of the paper

  void add(const Group& group) {
    if (group.code == 8) layer = group.value;
    if (group.code == 2) block = group.value;
    if (group.code == 230) backwards = number(group.value) < -0.5;
    if (group.code < 10 || group.code >= 80) return;
    const double v = value[static_cast<std::size_t>(group.code)] = number(group.value);
    if (group.code == 10) {
      points.emplace_back(v, 0);
      bulges.push_back(0);
    }
    if (group.code == 20 && !points.empty()) points.back().y() = v;
    if (group.code == 42 && !bulges.empty()) bulges.back() = v;
    if (group.code == 11) fit_points.emplace_back(v, 0);
    if (group.code == 21 && !fit_points.empty()) fit_points.back().y() = v;
    if ((group.code == 60 || group.code == 67) && v != 0) shown = false;  // invisible; of the paper
  }
  double of(std::size_t code, double absent) const { return value[code] != 0 ? value[code] : absent; }
  bool flag(std::size_t code, int bit) const { return (static_cast<int>(value[code]) & bit) != 0; }
};

std::string lower(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(),
                         [](unsigned char c) { return static_cast<char>(c < 128 ? std::tolower(c) : c); });
  return out;
}

/// English, German, Dutch, French, Spanish, Italian, Scandinavian, Portuguese.
bool names_walls(std::string_view layer) {
  static constexpr std::array<std::string_view, 10> k_words{"wall", "wand",  "waend",  "muur", "mur",
                                                            "muro", "pared", "parete", "vegg", "vaeg"};
  const auto name = lower(layer);
  return std::ranges::any_of(k_words,
                             [&](std::string_view word) { return name.find(word) != std::string::npos; });
}

/// Metres of one unit, by $INSUNITS: DXF reference, header variables. 0: unitless; nothing: no unit of it.
std::optional<double> unit_of(double code) {
  constexpr double k_survey_foot_m = 1200.0 / 3937.0;
  // Astronomical unit and parsec by resolutions B2 of the IAU, 2012 and 2015; a light year is a Julian one.
  constexpr std::array<double, 25> k_metres{0,
                                            0.0254,
                                            0.3048,
                                            1609.344,
                                            0.001,
                                            0.01,
                                            1,
                                            1000,
                                            2.54e-8,
                                            2.54e-5,
                                            0.9144,
                                            1e-10,
                                            1e-9,
                                            1e-6,
                                            0.1,
                                            10,
                                            100,
                                            1e9,
                                            149597870700.0,
                                            9460730472580800.0,
                                            3.0856775814913673e16,
                                            k_survey_foot_m,
                                            k_survey_foot_m / 12,
                                            3 * k_survey_foot_m,
                                            5280 * k_survey_foot_m};
  if (!(code >= 0 && code < k_metres.size())) return std::nullopt;
  return k_metres[static_cast<std::size_t>(code)];
}

struct Block {
  Vector2d base{0, 0};
  std::size_t at{};  ///< of its first entity
};

/// How the entities of a block come into the drawing.
struct Inserted {
  Affine2d place{Affine2d::Identity()};
  std::string_view layer{"0"};  ///< of what stands on layer 0 inside
  int depth{0};
};

class Reader {
 public:
  explicit Reader(std::string_view text) : text_(text) {}

  Result<Drawing> read() {
    BOOST_OUTCOME_TRY(const auto entities, index());
    if (!entities)
      return make_error(Errc::bad_frame, "the DXF has no section ENTITIES: save it again as ASCII DXF");
    BOOST_OUTCOME_TRYV(draw(*entities, {}));
    if (out_.lines.empty())
      return make_error(Errc::weak_geometry,
                        "the DXF shows no line in its model space: switch its layers on, or bind external "
                        "references (XREF)");
    return std::move(out_);
  }

 private:
  /// Header, layers and where each block begins; where the entities begin.
  Result<std::optional<std::size_t>> index() {
    Groups in(text_, 0);
    std::optional<std::size_t> entities;
    std::string_view section, variable, record;
    std::optional<Block> block;
    std::string_view block_name;
    Layer layer;
    while (true) {
      const auto at = in.at();
      BOOST_OUTCOME_TRY(const auto group, in.next());
      if (!group || (group->code == 0 && group->value == "EOF")) break;
      if (group->code == 0) {
        if (record == "LAYER") layer = kept(layer);
        if (block && block->at == 0 && group->value != "BLOCK") {
          block->at = at;
          blocks_[std::string(block_name)] = *block;
          block.reset();
        }
        record = group->value;
        if (record == "ENDSEC") section = {};
        if (record == "SECTION") section = "?";
        if (record == "BLOCK" && section == "BLOCKS") block.emplace();
        continue;
      }
      if (group->code == 2 && section == "?") {
        section = group->value;
        if (section == "ENTITIES") entities = in.at();
        continue;
      }
      if (section == "HEADER" && group->code == 9) variable = group->value;
      if (section == "HEADER" && group->code == 70 && variable == "$INSUNITS") {
        const auto unit_m = unit_of(number(group->value));
        if (!unit_m)
          return make_error(Errc::unsupported,
                            "$INSUNITS is " + to_utf8(group->value, 20) +
                                ", which is no unit of the DXF reference: set the unit of the "
                                "drawing in the CAD program and export it again");
        out_.unit_m = *unit_m;
      }
      if (record == "LAYER") layer.add(*group);
      if (block && group->code == 2) block_name = group->value;
      if (block && group->code == 10) block->base.x() = number(group->value);
      if (block && group->code == 20) block->base.y() = number(group->value);
    }
    return entities;
  }

  struct Layer {
    std::string_view name;
    bool hidden{false};
    void add(const Group& group) {
      if (group.code == 2) name = group.value;
      if (group.code == 62 && number(group.value) < 0) hidden = true;
      if (group.code == 70 && (static_cast<int>(number(group.value)) & 1) != 0) hidden = true;
    }
  };
  Layer kept(const Layer& layer) {
    if (layer.hidden) hidden_.insert(std::string(layer.name));
    return {};
  }

  /// The entities from `at` to the end of their section or block.
  Result<void> draw(std::size_t at, const Inserted& inserted) {
    Groups in(text_, at);
    std::optional<Entity> entity;
    std::optional<Entity> polyline;  ///< whose vertices follow
    while (true) {
      BOOST_OUTCOME_TRY(const auto group, in.next());
      if (++groups_ > k_max_groups) return too_much();
      if (group && group->code != 0) {
        if (entity) entity->add(*group);
        continue;
      }
      if (entity) {
        BOOST_OUTCOME_TRYV(ended(*entity, polyline, inserted));
      }
      if (!group || group->value == "ENDSEC" || group->value == "ENDBLK") return boost::outcome_v2::success();
      entity.emplace();
      entity->type = group->value;
    }
  }

  /// An entity is whole; a polyline only with its last vertex.
  Result<void> ended(Entity& entity, std::optional<Entity>& polyline, const Inserted& inserted) {
    if (entity.type == "POLYLINE") {
      polyline = std::move(entity);
      polyline->points.clear();
      polyline->bulges.clear();
    } else if (entity.type == "VERTEX" && polyline) {
      // 16: a control point of a fitted curve, beside the curve's own vertices.
      if (!entity.points.empty() && !entity.flag(70, 16)) {
        polyline->points.push_back(entity.points.front());
        polyline->bulges.push_back(entity.bulges.front());
      }
    } else if (entity.type == "SEQEND" && polyline) {
      const auto whole = std::move(*polyline);
      polyline.reset();
      return shape(whole, inserted);
    } else {
      return shape(entity, inserted);
    }
    return boost::outcome_v2::success();
  }

  Result<void> shape(const Entity& e, const Inserted& inserted) {
    const auto layer = e.layer == "0" ? inserted.layer : e.layer;
    if (!e.shown || hidden_.contains(std::string(e.layer)) || hidden_.contains(std::string(layer)) ||
        e.layer == "Defpoints")
      return boost::outcome_v2::success();
    if (e.type == "INSERT") return insert(e, layer, inserted);
    Affine2d place = inserted.place;
    // Plane entities of the other side of the paper: their x runs backwards.
    const bool own_plane = e.type == "ARC" || e.type == "CIRCLE" || e.type == "LWPOLYLINE" ||
                           e.type == "POLYLINE" || e.type == "SOLID";
    if (own_plane && e.backwards) place = place * Eigen::Scaling(-1.0, 1.0);
    wall_ = names_walls(layer);
    curve(e, place);
    return out_.lines.size() > k_max_drawn_lines ? too_much() : Result<void>(boost::outcome_v2::success());
  }

  void curve(const Entity& e, const Affine2d& place) {
    const Vector2d center = e.points.empty() ? Vector2d(0, 0) : e.points.front();
    if (e.type == "LINE" && !e.points.empty() && !e.fit_points.empty()) {
      line(place, e.points.front(), e.fit_points.front());
    } else if (e.type == "LWPOLYLINE" || (e.type == "POLYLINE" && !e.flag(70, 16 | 64))) {
      for (std::size_t i = 0; i + 1 < e.points.size(); ++i)
        bulged(place, e.points[i], e.points[i + 1], e.bulges[i]);
      if (e.flag(70, 1) && e.points.size() > 2)
        bulged(place, e.points.back(), e.points.front(), e.bulges.back());
    } else if (e.type == "CIRCLE") {
      arc(place, center, Vector2d(e.value[40], 0), 1, 0, 2 * std::numbers::pi);
    } else if (e.type == "ARC") {
      arc(place, center, Vector2d(e.value[40], 0), 1, e.value[50] * k_degree, e.value[51] * k_degree);
    } else if (e.type == "ELLIPSE" && !e.fit_points.empty()) {
      arc(place, center, e.fit_points.front(), e.value[40], e.value[41], e.of(42, 2 * std::numbers::pi));
    } else if (e.type == "SPLINE") {
      const auto& points = e.fit_points.size() > 1 ? e.fit_points : e.points;
      for (std::size_t i = 0; i + 1 < points.size(); ++i) line(place, points[i], points[i + 1]);
    } else if (e.type == "SOLID" || e.type == "3DFACE") {
      const auto corner = [&](std::size_t i) { return Vector2d(e.value[10 + i], e.value[20 + i]); };
      for (const auto& [a, b] : {std::pair{0, 1}, {1, 3}, {3, 2}, {2, 0}})
        line(place, corner(static_cast<std::size_t>(a)), corner(static_cast<std::size_t>(b)));
    }
  }

  void line(const Affine2d& place, const Vector2d& from, const Vector2d& to) {
    const Vector2d a = place * from, b = place * to;
    if (a != b && a.cwiseAbs().maxCoeff() <= k_largest && b.cwiseAbs().maxCoeff() <= k_largest)
      out_.lines.push_back({a, b, wall_});
  }

  /// An ellipse's arc: `major` from its centre, `ratio` of the other half axis, parameters in radians.
  void arc(const Affine2d& place, const Vector2d& center, const Vector2d& major, double ratio,
           double from_rad, double to_rad) {
    constexpr double k_turn = 2 * std::numbers::pi;
    from_rad = std::remainder(from_rad, k_turn);
    to_rad = std::remainder(to_rad, k_turn);
    if (to_rad <= from_rad + 1e-12) to_rad += k_turn;
    const Vector2d minor = ratio * Vector2d(-major.y(), major.x());
    const auto at = [&](double t) { return Vector2d(center + std::cos(t) * major + std::sin(t) * minor); };
    const int n = std::max(1, static_cast<int>(std::ceil((to_rad - from_rad) / k_step_rad)));
    for (int i = 0; i < n; ++i)
      line(place, at(from_rad + (to_rad - from_rad) * i / n),
           at(from_rad + (to_rad - from_rad) * (i + 1) / n));
  }

  /// Bulge: tangent of a quarter of the arc's angle, to the left of the way from the one to the other.
  void bulged(const Affine2d& place, const Vector2d& from, const Vector2d& to, double bulge) {
    if (std::abs(bulge) < 1e-6 || std::abs(bulge) > 1e3) return line(place, from, to);
    const Vector2d chord = to - from;
    const double angle = 4 * std::atan(bulge);
    const Vector2d center =
        0.5 * (from + to) + (1 - bulge * bulge) / (4 * bulge) * Vector2d(-chord.y(), chord.x());
    const int n = std::max(1, static_cast<int>(std::ceil(std::abs(angle) / k_step_rad)));
    Vector2d last = from;
    for (int i = 1; i <= n; ++i) {
      const Vector2d next =
          i == n ? to : Vector2d(center + Eigen::Rotation2Dd(angle * i / n) * (from - center));
      line(place, last, next);
      last = next;
    }
  }

  Result<void> insert(const Entity& e, std::string_view layer, const Inserted& inserted) {
    const auto found = blocks_.find(std::string(e.block));
    if (found == blocks_.end() || inserted.depth >= k_max_depth || e.points.empty())
      return boost::outcome_v2::success();
    const auto columns = static_cast<int>(std::clamp(e.of(70, 1), 1.0, 1e4)),
               rows = static_cast<int>(std::clamp(e.of(71, 1), 1.0, 1e4));
    const Eigen::Rotation2Dd turn(e.value[50] * k_degree);
    Affine2d to_parent = inserted.place;
    if (e.backwards) to_parent = to_parent * Eigen::Scaling(-1.0, 1.0);
    for (int column = 0; column < columns; ++column) {
      for (int row = 0; row < rows; ++row) {
        const Vector2d shift(column * e.value[44], row * e.value[45]);
        Inserted inner{to_parent * Eigen::Translation2d(e.points.front() + turn * shift) * turn *
                           Eigen::Scaling(e.of(41, 1), e.of(42, 1)) *
                           Eigen::Translation2d(-found->second.base),
                       layer, inserted.depth + 1};
        BOOST_OUTCOME_TRYV(draw(found->second.at, inner));
      }
    }
    return boost::outcome_v2::success();
  }

  static Error too_much() {
    return make_error(Errc::invalid_argument, "the DXF expands to more than " +
                                                  std::to_string(k_max_drawn_lines / 1'000'000) +
                                                  " million lines: save a single floor");
  }

  std::string_view text_;
  std::map<std::string, Block> blocks_;
  std::set<std::string> hidden_;  ///< layers
  Drawing out_;
  bool wall_{false};  ///< of the entity that is drawn
  std::size_t groups_{0};
};

}  // namespace

bool is_dxf(std::span<const std::byte> bytes) {
  const auto text = text_of(bytes);
  if (text.starts_with(k_binary)) return true;
  Groups in(text.substr(0, 4096), 0);
  for (auto group = in.next(); group && group.value(); group = in.next())
    if (group.value()->code != 999) return group.value()->code == 0 && group.value()->value == "SECTION";
  return false;
}

Result<Drawing> read_dxf(std::span<const std::byte> bytes) {
  const auto text = text_of(bytes);
  if (text.starts_with(k_binary))
    return make_error(Errc::unsupported, "the file is a binary DXF: save it as ASCII DXF");
  return Reader(text).read();
}

}  // namespace anchord::floor_plan
