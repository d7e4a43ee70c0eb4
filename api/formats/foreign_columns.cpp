#include "api/formats/foreign_columns.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "api/formats/foreign_meaning.hpp"
#include "api/formats/globe_track.hpp"

namespace anchord::api {
namespace {

constexpr std::array k_track_fields{
    "time",    "zone",    "lat",     "lon", "height",     "separation", "x",  "y",  "z",  "fix", "sigma_h",
    "sigma_v", "sigma_e", "sigma_n", "age", "satellites", "heading",    "qx", "qy", "qz", "qw"};
constexpr std::array k_range_fields{"time", "zone", "anchor", "range",   "tag", "rss",
                                    "rx",   "fp",   "seq",    "antenna", "kind"};

template <std::size_t N>
ForeignColumns guessed(const ForeignTable& table, const std::array<const char*, N>& fields) {
  std::map<std::string, std::string, std::less<>> by_name;
  for (const auto& column : table.columns()) by_name[plain_name(column)] = column;
  ForeignColumns out;
  for (const std::string_view field : fields) {
    const auto known = std::ranges::find(k_foreign_fields, field, &FieldNames::field);
    for (std::string_view names = known->names; !names.empty();) {
      const auto end = names.find(' ');
      const auto found = by_name.find(names.substr(0, end));
      if (found != by_name.end()) {
        out.emplace(field, found->second);
        break;
      }
      names.remove_prefix(end == std::string_view::npos ? names.size() : end + 1);
    }
  }
  return out;
}

std::string_view name_at(const ForeignColumns& columns, std::string_view field) {
  const auto at = columns.find(field);
  return at == columns.end() ? std::string_view() : std::string_view(at->second);
}

bool beyond(const std::vector<double>& values, double most) {
  return std::ranges::any_of(values, [&](double v) { return std::abs(v) > most; });
}

PlaceKind degrees_kind(const ForeignTable& table, std::string_view lat, std::string_view lon) {
  const auto lats = table.sample_numbers(lat), lons = table.sample_numbers(lon);
  if (!beyond(lats, 90) && !beyond(lons, 180)) return PlaceKind::degrees;
  // Autopilots write whole numbers of 1e-7 degrees; a northing is below 1e7 m.
  const auto whole = [](double v) { return v == std::trunc(v); };
  const bool scaled = std::ranges::all_of(lats, whole) && std::ranges::all_of(lons, whole) &&
                      (beyond(lats, 1e7) || beyond(lons, 1e7));
  return scaled && !beyond(lats, 90e7) && !beyond(lons, 180e7) ? PlaceKind::degrees_1e7
                                                               : PlaceKind::no_degrees;
}

std::vector<std::string> without_column(const ForeignColumns& columns,
                                        std::initializer_list<const char*> fields) {
  std::vector<std::string> out;
  for (const char* field : fields) {
    if (!columns.contains(field)) out.emplace_back(field);
  }
  return out;
}

}  // namespace

std::string plain_name(std::string_view name) {
  std::string out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    char c = name[i];
    // The umlauts of UTF-8, large and small.
    if (c == '\xC3' && i + 1 < name.size()) {
      const char second = name[i + 1];
      const char vowel = second == '\xA4' || second == '\x84'   ? 'a'
                         : second == '\xB6' || second == '\x96' ? 'o'
                         : second == '\xBC' || second == '\x9C' ? 'u'
                                                                : '\0';
      if (vowel != '\0') {
        out += vowel;
        out += 'e';
        ++i;
        continue;
      }
    }
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    const bool kept = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (kept)
      out += c;
    else if (!out.ends_with('_'))
      out += '_';
  }
  if (out.starts_with('_')) out.erase(0, 1);
  if (out.ends_with('_')) out.pop_back();
  return out;
}

ForeignColumns guessed_track_columns(const ForeignTable& table) {
  ForeignColumns out = guessed(table, k_track_fields);
  const auto take = [&out](const char* field) {
    auto node = out.extract(field);
    return node.empty() ? std::optional<std::string>() : std::optional(std::move(node.mapped()));
  };
  const bool globe = out.contains("lat") && out.contains("lon");
  for (const char* axis : {"lat", "lon"})
    if (const auto letters = hemisphere_column(table, out, axis))
      out[std::string(axis) + "_hemisphere"] = *letters;
  // Columns called latitude and longitude that hold metres are those of a map. What is near zero and no
  // degree may be degrees and minutes, or one for the other: a person says it.
  if (globe && out.contains("height") &&
      degrees_kind(table, out.at("lat"), out.at("lon")) == PlaceKind::no_degrees &&
      (beyond(table.sample_numbers(out.at("lat")), k_most_local_m) ||
       beyond(table.sample_numbers(out.at("lon")), k_most_local_m))) {
    out["x"] = *take("lon");
    out["y"] = *take("lat");
    out["z"] = *take("height");
  } else if (!globe && out.contains("x") && out.contains("y") && !out.contains("z") &&
             out.contains("height")) {
    // Easting and northing have a height beside them.
    take("lat");
    take("lon");
    out["z"] = *take("height");
  }
  return out;
}
ForeignColumns guessed_range_columns(const ForeignTable& table) { return guessed(table, k_range_fields); }

std::vector<std::string> missing_track_fields(const ForeignColumns& columns) {
  auto out = without_column(columns, {"time"});
  const auto globe = without_column(columns, {"lat", "lon", "height"});
  if (!globe.empty() && !without_column(columns, {"x", "y", "z"}).empty())
    out.insert(out.end(), globe.begin(), globe.end());
  return out;
}
std::vector<std::string> missing_range_fields(const ForeignColumns& columns) {
  return without_column(columns, {"time", "anchor", "range"});
}

bool is_local(const ForeignColumns& columns) {
  return !without_column(columns, {"lat", "lon", "height"}).empty();
}

PlaceKind place_kind(const ForeignTable& table, const ForeignColumns& columns) {
  if (!is_local(columns)) return degrees_kind(table, columns.at("lat"), columns.at("lon"));
  std::array<std::vector<double>, 3> axes;
  double square = 0;
  bool far = false;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto name = name_at(columns, std::array{"x", "y", "z"}[i]);
    if (plain_name(name).find("ecef") != std::string::npos) return PlaceKind::ecef;
    axes[i] = table.sample_numbers(name);
    if (!axes[i].empty()) square += axes[i].front() * axes[i].front();
    far = far || beyond(axes[i], k_most_local_m);
  }
  // On the surface of the earth, and not a northing of that size with a height beside it.
  const double from_centre_m = std::sqrt(square);
  if (from_centre_m > 6.3e6 && from_centre_m < 6.4e6 && beyond(axes[2], k_most_local_m))
    return PlaceKind::ecef;
  return far ? PlaceKind::map : PlaceKind::local;
}

}  // namespace anchord::api
