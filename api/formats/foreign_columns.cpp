#include "api/formats/foreign_columns.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "api/formats/foreign_axes.hpp"
#include "api/formats/foreign_meaning.hpp"
#include "api/formats/foreign_values.hpp"
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

/// Behind the last "_" of a plain name, and before it.
struct Parts {
  std::string before, last;
  const std::string* column;
};
std::vector<Parts> parts_of(const ForeignTable& table) {
  std::vector<Parts> out;
  for (const auto& column : table.columns()) {
    std::string name = plain_name(column);
    if (name.ends_with("_m")) name.resize(name.size() - 2);
    const auto at = name.rfind('_');
    if (at != std::string::npos) out.push_back({name.substr(0, at), name.substr(at + 1), &column});
  }
  return out;
}

bool is_one_of(std::string_view words, const std::string& word) {
  return !word.empty() && contains(words, ' ' + word + ' ');
}

/// Columns of one message that have one name before their own (pose.position.x of ROS): those of the only
/// name, among the ones that `accepted` takes, that has a column for each field. `words`: for each field its
/// last parts.
template <std::size_t N, class Accepted>
std::optional<std::array<std::string, N>> of_one_message(const std::vector<Parts>& parts,
                                                         const std::array<const char*, N>& words,
                                                         const Accepted& accepted) {
  std::optional<std::array<std::string, N>> out;
  std::set<std::string> names;
  for (const auto& part : parts) names.insert(part.before);
  for (const auto& name : names) {
    if (!accepted(name)) continue;
    std::array<std::string, N> columns;
    bool complete = true;
    for (std::size_t i = 0; i < N; ++i) {
      std::size_t n = 0;
      for (const auto& part : parts) {
        if (part.before != name || !is_one_of(words[i], part.last)) continue;
        columns[i] = *part.column;
        ++n;
      }
      complete = complete && n == 1;
    }
    if (!complete) continue;
    if (out) return std::nullopt;
    out = columns;
  }
  return out;
}

std::string last_word(const std::string& name) { return name.substr(name.rfind('_') + 1); }

/// A field whose name is the last part of one column alone.
void add_by_ending(const std::vector<Parts>& parts, const char* field, std::string_view words,
                   ForeignColumns& out) {
  const std::string* found = nullptr;
  for (const auto& part : parts) {
    if (!is_one_of(words, part.last)) continue;
    if (found != nullptr) return;
    found = part.column;
  }
  if (found != nullptr) out.try_emplace(field, *found);
}

/// Places and attitudes whose columns are called by the messages that they were in.
void add_place_by_endings(const ForeignTable& table, ForeignColumns& out) {
  const auto parts = parts_of(table);
  if (!out.contains("time")) add_by_ending(parts, "time", " time timestamp timeus ", out);
  const auto has = [&](std::initializer_list<const char*> fields) {
    return std::ranges::all_of(fields, [&](const char* f) { return out.contains(f); });
  };
  if (has({"lat", "lon"}) || has({"x", "y"})) return;
  if (const auto globe =
          of_one_message<3>(parts, {" lat latitude ", " lon lng longitude ", " alt altitude height "},
                            [](const auto&) { return true; })) {
    for (std::size_t i = 0; i < 3; ++i) out[std::array{"lat", "lon", "height"}[i]] = (*globe)[i];
    return;
  }
  const auto place = of_one_message<3>(parts, {" x ", " y ", " z "}, [](const std::string& name) {
    return is_one_of(" position pos translation pose point location stateestimate ned ", last_word(name));
  });
  if (!place) return;
  for (std::size_t i = 0; i < 3; ++i) out[std::array{"x", "y", "z"}[i]] = (*place)[i];
  const auto turn = of_one_message<4>(parts, {" x ", " y ", " z ", " w "}, [](const std::string& name) {
    return is_one_of(" orientation rotation quaternion ", last_word(name));
  });
  for (std::size_t i = 0; turn && i < 4; ++i)
    out.try_emplace(std::array{"qx", "qy", "qz", "qw"}[i], (*turn)[i]);
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
  add_place_by_endings(table, out);
  // North, east and down by their first letters.
  if (!out.contains("z") && !out.contains("height") && is_east(name_at(out, "x")))
    for (const auto& column : table.columns())
      if (const auto name = plain_name(column); name == "d" || name == "d_m") out["z"] = column;
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
ForeignColumns guessed_range_columns(const ForeignTable& table) {
  ForeignColumns out = guessed(table, k_range_fields);
  const auto parts = parts_of(table);
  for (const auto& [field, words] :
       {std::pair{"time", " time timestamp timeus "}, std::pair{"anchor", " anchor "},
        std::pair{"range", " range distance "}, std::pair{"tag", " tag "}})
    if (!out.contains(field)) add_by_ending(parts, field, words, out);
  return out;
}

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
