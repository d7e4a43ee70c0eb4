#include "api/formats/foreign_flight.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "api/formats/foreign_values.hpp"
#include "api/formats/globe_track.hpp"
#include "api/wire/row_limits.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::string_view k_needs_time_of_ranges = "time of the ranges", k_needs_tag = "tag address",
                           k_needs_fix = "fix numbers", k_needs_degrees = "degrees", k_needs_crs = "crs",
                           k_needs_heights = "heights", k_needs_heading = "heading",
                           k_needs_addresses = "addresses";

std::string_view column_of(const ForeignColumns& columns, std::string_view field) {
  const auto at = columns.find(field);
  return at == columns.end() ? std::string_view() : std::string_view(at->second);
}

/// Those known by name, with what a person says in their place.
ForeignColumns merged(ForeignColumns guessed, const ForeignColumns& said) {
  // Whoever names a column of one kind of place means no other.
  const auto says = [&](std::initializer_list<const char*> fields) {
    return std::ranges::any_of(fields, [&](const char* f) { return said.contains(f); });
  };
  if (says({"lat", "lon", "height"}) && !says({"x", "y", "z"}))
    for (const char* f : {"x", "y", "z"}) guessed.erase(f);
  if (says({"x", "y", "z"}) && !says({"lat", "lon", "height"}))
    for (const char* f : {"lat", "lon", "height"}) guessed.erase(f);
  for (const auto& [field, column] : said) {
    if (column.empty())
      guessed.erase(field);
    else
      guessed[field] = column;
  }
  return guessed;
}

/// How the values are written.
struct Reading {
  ForeignColumns tc, rc;
  PlaceKind kind{};
  bool local{};  ///< x, y, z
  TimeReading track_time, range_time;
  double range_per_metre{1}, height_per_metre{1};
  std::optional<FixNumbers> fix;
  std::optional<HeadingKind> heading;
  std::optional<AddressKind> addresses;
  std::optional<std::string> crs, heights;
  bool heights_matter{};
  std::string wrong_unit;  ///< what a column of units says that is not read
};

/// Lengths whose unit stands in a column of its own; those that an option gives are not looked at.
void read_units(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& o, Reading& r) {
  const auto look = [&](const ForeignTable& table, const ForeignColumns& columns, const char* field,
                        double* per_metre_out) {
    const auto beside = unit_column(table, columns, field);
    if (!beside) return;
    if (per_metre_out != nullptr && beside->unit) {
      *per_metre_out = per_metre(*beside->unit);
    } else if (beside->unit != LengthUnit::m && r.wrong_unit.empty()) {
      r.wrong_unit = table.name() + ": the column '" + beside->name + "' says that '" +
                     std::string(column_of(columns, field)) + "' is in " + beside->word +
                     ": write it in metres" +
                     (per_metre_out != nullptr ? ", centimetres or millimetres" : "");
    }
  };
  if (!o.range_unit) look(ranges, r.rc, "range", &r.range_per_metre);
  if (!o.height_unit) look(track, r.tc, r.local ? "z" : "height", &r.height_per_metre);
  for (const char* field : {"separation", "x", "y"}) look(track, r.tc, field, nullptr);
}

std::optional<HeadingKind> heading_of(const ForeignTable& track, const ForeignColumns& tc) {
  if (!tc.contains("heading")) return HeadingKind::deg;
  for (const char* part : {"qx", "qy", "qz", "qw"})
    if (!tc.contains(part)) return heading_kind(track, column_of(tc, "heading"));
  return HeadingKind::deg;  // attitudes come before a heading
}

/// Nothing where nothing says it, and where it is sea level by a geoid that nothing names.
std::optional<std::string> heights_by_name(const ForeignTable& track, const Reading& reading) {
  const std::string name = plain_name(column_of(reading.tc, reading.local ? "z" : "height"));
  if (contains(name, "msl") || contains(name, "orthometric") || contains(name, "sea_level") ||
      contains(name, "nhn"))
    return reading.tc.contains("separation") ? std::optional<std::string>("column") : std::nullopt;
  for (std::string_view rest = name; !rest.empty();) {
    const auto word = rest.substr(0, rest.find('_'));
    if (word == "ell" || word == "hae" || word.starts_with("ellips")) return "ellipsoidal";
    rest.remove_prefix(std::min(rest.size(), word.size() + 1));
  }
  return name == "h_m" || track.ellipsoidal() ? std::optional<std::string>("ellipsoidal") : std::nullopt;
}

Reading reading_of(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& o) {
  Reading r;
  r.tc = merged(guessed_track_columns(track), o.track_columns);
  r.rc = merged(guessed_range_columns(ranges), o.range_columns);
  r.local = is_local(r.tc);
  r.kind = place_kind(track, r.tc);
  r.track_time = time_reading(track, column_of(r.tc, "time"));
  r.range_time = time_reading(ranges, column_of(r.rc, "time"));
  r.track_time = {o.track_time_unit.value_or(r.track_time.unit),
                  o.track_time_scale.value_or(r.track_time.scale)};
  r.range_time = {o.range_time_unit.value_or(r.range_time.unit),
                  o.range_time_scale.value_or(r.range_time.scale)};
  r.range_per_metre = per_metre(o.range_unit.value_or(range_unit(ranges, column_of(r.rc, "range"))));
  r.fix = o.fix_numbers;
  if (!r.tc.contains("fix"))
    r.fix = FixNumbers::words;
  else if (!r.fix)
    r.fix = fix_numbers(track, column_of(r.tc, "fix"));
  r.heading = o.heading ? o.heading : heading_of(track, r.tc);
  r.addresses = o.addresses;
  if (!r.addresses && !may_be_hexadecimal(ranges, column_of(r.rc, "anchor")) &&
      !may_be_hexadecimal(ranges, column_of(r.rc, "tag"), o.tag))
    r.addresses = AddressKind::as_written;
  r.crs = o.crs;
  if (!r.crs && r.kind != PlaceKind::map) r.crs = r.kind == PlaceKind::ecef ? "ECEF" : "";
  r.heights = o.heights ? o.heights : heights_by_name(track, r);
  const auto height = column_of(r.tc, r.local ? "z" : "height");
  const auto values = track.sample_numbers(height);
  // Who writes whole numbers of 1e-7 degrees writes whole millimetres.
  const bool whole_mm = r.kind == PlaceKind::degrees_1e7 &&
                        std::ranges::all_of(values, [](double v) { return v == std::trunc(v); });
  const auto by_name = unit_of_name(height);
  r.height_per_metre =
      per_metre(o.height_unit.value_or(by_name.value_or(whole_mm ? LengthUnit::mm : LengthUnit::m)));
  read_units(track, ranges, o, r);
  const bool ecef = r.crs && plain_name(*r.crs) == "ecef";
  r.heights_matter = !r.local || (!(r.crs && r.crs->empty()) && !ecef);
  return r;
}

Needs needs_of(const Reading& r, const std::string& tag) {
  Needs out = missing_track_fields(r.tc);
  for (const auto& field : missing_range_fields(r.rc))
    out.push_back(field == "time" ? std::string(k_needs_time_of_ranges) : field);
  if (!r.rc.contains("tag") && tag.empty()) out.emplace_back(k_needs_tag);
  if (!r.fix) out.emplace_back(k_needs_fix);
  if (!r.heading) out.emplace_back(k_needs_heading);
  if (!r.addresses) out.emplace_back(k_needs_addresses);
  if (r.kind == PlaceKind::no_degrees) out.emplace_back(k_needs_degrees);
  if (!r.crs) out.emplace_back(k_needs_crs);
  if (r.heights_matter && !r.heights) out.emplace_back(k_needs_heights);
  return out;
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const auto& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

/// What is not known, and which option says it.
std::string words_of(const std::string& need, const ForeignTable& track, const ForeignTable& ranges,
                     const Reading& r) {
  const std::string column_option = " (have: " + listed(track.columns()) + "): --column track.";
  if (need == k_needs_tag) return "no column has the tag: give --tag 0x6e01, or --column ranges.tag=NAME";
  if (need == k_needs_fix)
    return track.name() + ": 1 and 2 in '" + std::string(column_of(r.tc, "fix")) +
           "' have different meanings in different programs: give --fix-numbers solution, nmea, rtklib or "
           "mavlink";
  if (need == k_needs_heading)
    return track.name() + ": '" + std::string(column_of(r.tc, "heading")) +
           "' has no unit, and no value beyond two pi: give --heading deg or rad (clockwise from true "
           "north), "
           "deg_ccw_from_east or rad_ccw_from_east (ROS)";
  if (need == k_needs_addresses)
    return ranges.name() +
           ": addresses look like hexadecimal numbers without 0x, 1021 beside 9E04: give --addresses hex, or "
           "names where they are names and decimal numbers";
  if (need == k_needs_degrees)
    return track.name() +
           ": the columns of latitude and longitude are not in decimal degrees (degrees and minutes, or one "
           "for the other?): write decimal degrees, exchange them with --column track.lat=NAME and "
           "track.lon, "
           "or give --column track.x=NAME, track.y, track.z and --crs EPSG:CODE of a map";
  if (need == k_needs_crs)
    return track.name() + ": x, y, z are " + k_of_a_map + ": --crs EPSG:25832, UTM 32N or ECEF";
  if (need == k_needs_heights)
    return track.name() + ": it is not stated what the heights in '" +
           std::string(column_of(r.tc, r.local ? "z" : "height")) +
           "' are above: --heights ellipsoidal, EPSG:5773 (mean sea level, EGM96), metres of the geoid "
           "there, or "
           "column with --column track.separation=NAME";
  if (need == k_needs_time_of_ranges || need == "anchor" || need == "range") {
    const std::string field = need == k_needs_time_of_ranges ? "time" : need;
    return ranges.name() + ": no column was found for the " + field + " (have: " + listed(ranges.columns()) +
           "): --column ranges." + field + "=NAME" + (need == "range" ? ", or --column-for-each-anchor" : "");
  }
  return track.name() + ": no column was found for " + need + column_option + need + "=NAME";
}

Result<void> check_columns(const ForeignTable& table, const ForeignColumns& columns, const char* of) {
  for (const auto& [field, column] : columns) {
    if (std::ranges::find(k_foreign_fields, field, &FieldNames::field) == k_foreign_fields.end())
      return make_error(Errc::invalid_argument, std::string(of) + '.' + field + ": there is no such field");
    if (!column.empty() && !table.column(column))
      return make_error(Errc::invalid_argument, table.name() + ": there is no column '" + column +
                                                    "' (have: " + listed(table.columns()) + ')');
  }
  return boost::outcome_v2::success();
}

/// Cells of a table by field.
class Cells {
 public:
  Cells(const ForeignTable& table, const ForeignColumns& columns) : table_(table), columns_(columns) {}
  struct At {
    const ForeignTable* table;
    std::optional<std::size_t> column;
    std::string_view text(std::size_t row) const {
      return column ? table->cell(row, *column) : std::string_view();
    }
    std::optional<double> number(std::size_t row) const {
      const double value = table->number(text(row));
      return std::isfinite(value) ? std::optional(value) : std::nullopt;
    }
  };
  At operator()(std::string_view field) const { return {&table_, table_.column(column_of(columns_, field))}; }

 private:
  const ForeignTable& table_;
  const ForeignColumns& columns_;
};

std::string row_text(const ForeignTable& table, std::size_t row, const std::string& what) {
  return table.name() + " row " + std::to_string(row + 2) + ": " + what;
}
std::string no_time(std::string_view cell) {
  return '"' + to_utf8(cell, 40) + "\" is not a time that can be read (like 2026-05-04 10:00:01.5)";
}

std::string time_text(std::size_t row, const Cells::At& time, const Cells::At& zone, const TimeReading& how) {
  return how.unit == TimeUnit::date ? with_zone(time.text(row), zone.text(row)) : std::string(time.text(row));
}

/// Reads positions of one table.
class TrackReader {
 public:
  TrackReader(const ForeignTable& table, const Reading& reading, std::int64_t epoch_us)
      : table_(table), reading_(reading), epoch_us_(epoch_us), cells_(table, reading.tc) {
    own_frame_ = reading.local && reading.crs->empty();
    if (reading.heights_matter && reading.heights == "column") separation_ = cells_("separation");
  }

  void read(ForeignFlight& out) const {
    for (std::size_t row = 0; row < table_.n_rows(); ++row) {
      const auto moment = time_text(row, time_, zone_, reading_.track_time);
      const auto time = time_us(table_, moment, reading_.track_time, epoch_us_);
      const auto at = place(row);
      const std::string wrong = !time                     ? no_time(moment)
                                : wrong_place(at).empty() ? wrong_sigma(row)
                                                          : wrong_place(at);
      if (!wrong.empty()) {
        out.refused.push_back(row_text(table_, row, wrong));
        continue;
      }
      Fix fix;
      fix.time = UtcTime::from_us(*time);
      fix.seq = row;
      fix.frame = TrackFrame::local;
      fix.local_m = *at;
      fix.fix = class_of(row, out.unknown_fix);
      add_uncertainty(row, fix);
      add_attitude(row, fix);
      fix.correction_age_s = age_.number(row);
      if (const auto n = satellites_.number(row); n && *n >= 0 && *n < 1000)
        fix.satellites = static_cast<int>(*n);
      out.data.fixes.push_back(std::move(fix));
    }
  }

 private:
  std::optional<Eigen::Vector3d> place(std::size_t row) const {
    const auto x = with_sign(x_.number(row), row, east_), y = with_sign(y_.number(row), row, north_),
               z = z_.number(row);
    const auto geoid = separation_ ? separation_->number(row) : std::optional(0.0);
    if (!x || !y || !z || !geoid) return std::nullopt;
    const double per_degree = reading_.kind == PlaceKind::degrees_1e7 ? 1e7 : 1;
    return Eigen::Vector3d(*x / per_degree, *y / per_degree, *z / reading_.height_per_metre + *geoid);
  }
  /// By the letter of its hemisphere; nothing where it has none, or a sign that says the other one.
  static std::optional<double> with_sign(std::optional<double> value, std::size_t row,
                                         const Cells::At& letter) {
    if (!value || !letter.column) return value;
    const auto sign = hemisphere_sign(letter.text(row));
    if (!sign || (*value < 0 && *sign > 0)) return std::nullopt;
    return *sign * std::abs(*value);
  }
  /// What can be no place of this kind; looked at in each row, for the first ones may look otherwise.
  std::string wrong_place(const std::optional<Eigen::Vector3d>& at) const {
    // Both zero is what a receiver without a fix writes.
    if (!at || (!own_frame_ && at->x() == 0 && at->y() == 0)) return "no position";
    if (!reading_.local)
      return std::abs(at->x()) > 180 || std::abs(at->y()) > 90 ? "latitude or longitude is not in degrees"
                                                               : "";
    return own_frame_ && is_of_a_map(*at)
               ? "x, y, z are more than 100 km from zero: a coordinate system is needed"
               : "";
  }
  /// Receivers and recorders write 0 for one they do not know.
  static std::optional<double> known_sigma(const Cells::At& cells, std::size_t row) {
    const auto value = cells.number(row);
    return value && *value == 0 ? std::nullopt : value;
  }
  std::string wrong_sigma(std::size_t row) const {
    for (const auto* sigma : {&sigma_h_, &sigma_v_, &sigma_e_, &sigma_n_})
      if (const auto value = known_sigma(*sigma, row); value && !row_limits::k_sigma_m.hold(*value))
        return "the standard deviation is not 0.00001 to 1000 m";
    return "";
  }
  FixClass class_of(std::size_t row, std::map<std::string, std::size_t>& unknown) const {
    if (!fix_.column) return FixClass::rtk_fixed;
    if (const auto known = fix_of(fix_.text(row), *reading_.fix)) return *known;
    ++unknown[to_utf8(fix_.text(row), 40)];
    return FixClass::none;
  }
  void add_uncertainty(std::size_t row, Fix& fix) const {
    const auto both = known_sigma(sigma_h_, row), up = known_sigma(sigma_v_, row);
    auto east = known_sigma(sigma_e_, row), north = known_sigma(sigma_n_, row);
    if (!east) east = both;
    if (!north) north = both;
    if (up && east && north) fix.covariance_m2 = row_limits::covariance_of_sigmas({*east, *north, *up});
  }
  void add_attitude(std::size_t row, Fix& fix) const {
    const auto x = qx_.number(row), y = qy_.number(row), z = qz_.number(row), w = qw_.number(row);
    if (x && y && z && w)
      fix.enu_from_body = row_limits::rotation_of({*x, *y, *z, *w});
    else if (const auto to = heading_.number(row))
      fix.enu_from_body = row_limits::rotation_of_heading(north_deg(*to, *reading_.heading));
  }

  const ForeignTable& table_;
  const Reading& reading_;
  std::int64_t epoch_us_;
  Cells cells_;
  bool own_frame_{};
  std::optional<Cells::At> separation_;
  Cells::At time_ = cells_("time"), zone_ = cells_("zone"),
            north_ = cells_(reading_.local ? "" : "lat_hemisphere"),
            east_ = cells_(reading_.local ? "" : "lon_hemisphere"), x_ = cells_(reading_.local ? "x" : "lon"),
            y_ = cells_(reading_.local ? "y" : "lat"), z_ = cells_(reading_.local ? "z" : "height"),
            fix_ = cells_("fix"), sigma_h_ = cells_("sigma_h"), sigma_v_ = cells_("sigma_v"),
            sigma_e_ = cells_("sigma_e"), sigma_n_ = cells_("sigma_n"), qx_ = cells_("qx"),
            qy_ = cells_("qy"), qz_ = cells_("qz"), qw_ = cells_("qw"), heading_ = cells_("heading"),
            age_ = cells_("age"), satellites_ = cells_("satellites");
};

Result<void> read_ranges(const ForeignTable& table, const Reading& reading, const ForeignOptions& o,
                         ForeignFlight& out) {
  const Cells cells(table, reading.rc);
  const auto time = cells("time"), zone = cells("zone"), distance = cells("range"), anchor = cells("anchor"),
             tag = cells("tag"), kind = cells("kind"), rss = cells("rss"), rx = cells("rx"), fp = cells("fp"),
             seq = cells("seq"), antenna = cells("antenna");
  std::map<NetworkId, std::string> names;  // of anchors that have a name alone
  for (std::size_t row = 0; row < table.n_rows(); ++row) {
    const auto moment = time_text(row, time, zone, reading.range_time);
    const auto us = time_us(table, moment, reading.range_time, o.epoch_us);
    const auto metres = distance.number(row);
    const std::string who(anchor.text(row)), of(tag.text(row).empty() ? o.tag : tag.text(row));
    const std::string wrong = of.empty()    ? "no tag"
                              : who.empty() ? "no anchor"
                              : !us         ? no_time(moment)
                              : !metres     ? "no range"
                                            : "";
    if (!wrong.empty()) {
      out.refused.push_back(row_text(table, row, wrong));
      continue;
    }
    const auto id = foreign_id(who, *reading.addresses);
    if (id.is_name) {
      const auto& other = names.try_emplace(id.id, who).first->second;
      if (other != who)
        return make_error(Errc::invalid_argument, "the names \"" + who + "\" and \"" + other +
                                                      "\" give the same address: rename one of them");
    }
    out.data.anchor_names.try_emplace(id.id, who);
    Range range;
    range.time = UtcTime::from_us(*us);
    range.tag = foreign_id(of, *reading.addresses).id;
    range.anchor = id.id;
    range.distance_m = *metres / reading.range_per_metre;
    if (kind.text(row) == "anchor_anchor") range.kind = RangeKind::anchor_anchor;
    range.seq = row;
    if (const auto n = seq.number(row); n && *n >= 0 && *n < 9e15) range.seq = static_cast<std::uint64_t>(*n);
    if (const auto n = antenna.number(row); n && *n >= 0 && *n <= 255)
      range.antenna = static_cast<std::uint8_t>(*n);
    range.rss_dbm = rss.number(row);
    range.rx_dbm = rx.number(row);
    range.fp_dbm = fp.number(row);
    out.data.ranges.push_back(std::move(range));
  }
  return boost::outcome_v2::success();
}

/// A pose in each range: several of one moment are one position, the last one.
void keep_once(std::vector<Fix>& fixes) {
  std::map<std::int64_t, std::size_t> at;
  std::vector<Fix> once;
  for (auto& fix : fixes) {
    const auto [where, fresh] = at.try_emplace(fix.time.ns, once.size());
    if (fresh)
      once.push_back(std::move(fix));
    else
      once[where->second] = std::move(fix);
  }
  fixes = std::move(once);
}

Mission mission_of(const ForeignOptions& o, const std::vector<Range>& ranges) {
  Mission mission;
  mission.name = o.name.empty() ? "Imported flight" : o.name;
  mission.kit = o.kit;
  mission.point = o.point;
  mission.lever_arm_sigma_m = o.lever_arm_sigma_m;
  mission.state = MissionState::finished;
  std::set<std::pair<NetworkId, std::uint8_t>> seen;
  for (const auto& range : ranges) {
    if (range.kind == RangeKind::tag_anchor && seen.emplace(range.tag, range.antenna).second)
      mission.tags.push_back({range.tag, range.antenna, o.lever_arm_body_m});
  }
  if (!ranges.empty()) mission.created = ranges.front().time;
  return mission;
}

/// Positions in degrees are on the globe at once where their heights are; else the server's PROJ is asked.
Result<std::optional<SourceCrsSpec>> source_of(const Reading& r, double max_datum_error_m) {
  SourceCrsSpec spec;
  spec.max_datum_error_m = max_datum_error_m;
  const std::string heights =
      r.heights_matter && r.heights && r.heights != "column" ? *r.heights : "ellipsoidal";
  BOOST_OUTCOME_TRYV(read_heights(heights, spec));
  if (r.local && r.crs->empty()) return std::optional<SourceCrsSpec>{};
  spec.crs = r.local ? *r.crs : "EPSG:4326";
  if (!r.local && plain_name(heights) == "ellipsoidal") return std::optional<SourceCrsSpec>{};
  return std::optional(spec);
}

/// What no field uses, so that nobody takes it for read.
void note_unused(const ForeignTable& table, std::initializer_list<const ForeignColumns*> used,
                 std::initializer_list<const char*> lengths, std::vector<std::string>& notes) {
  std::set<std::string_view> known;
  std::set<std::string> of_units;
  for (const auto* columns : used) {
    for (const auto& [field, column] : *columns) known.insert(column);
    for (const char* field : lengths)
      if (const auto beside = unit_column(table, *columns, field)) of_units.insert(beside->name);
  }
  std::vector<std::string> left;
  for (const auto& column : table.columns())
    if (!column.empty() && !known.contains(column) && !of_units.contains(column))
      left.push_back(to_utf8(column, 40));
  if (left.empty()) return;
  const auto n = left.size();
  if (n > 20) left.resize(20);
  notes.push_back(table.name() + ": columns that are not used: " + listed(left) +
                  (n > 20 ? " and " + std::to_string(n - 20) + " more" : ""));
}

void add_notes(const ForeignTable& track, const ForeignTable& ranges, const Reading& r, ForeignFlight& out) {
  auto& notes = out.data.notes;
  if (&track == &ranges) {
    note_unused(track, {&r.tc, &r.rc}, {"range", "height", "z"}, notes);
  } else {
    note_unused(track, {&r.tc}, {"height", "z"}, notes);
    note_unused(ranges, {&r.rc}, {"range"}, notes);
  }
  if (!r.tc.contains("fix"))
    notes.push_back(track.name() + ": no column is the fix class, every position is used as RTK fixed");
  if (r.fix == FixNumbers::gnss)
    notes.push_back(track.name() +
                    ": \"FIX\" is taken as a position without RTK; --fix-numbers words where it "
                    "is RTK fixed");
  for (const auto& [word, n] : out.unknown_fix)
    notes.push_back(track.name() + ": " + std::to_string(n) + " positions have the fix class \"" + word +
                    "\", which is unknown: they count as no fix");
  if (!out.refused.empty())
    notes.push_back(std::to_string(out.refused.size()) + " rows left out, the first: " + out.refused.front());
  if (out.data.fixes.empty() || out.data.ranges.empty()) return;
  const auto [first, last] = std::ranges::minmax_element(out.data.fixes, {}, &Fix::time);
  const auto outside = std::ranges::count_if(
      out.data.ranges,
      [&, from = first->time, to = last->time](const Range& x) { return x.time < from || x.time > to; });
  if (2 * static_cast<std::size_t>(outside) > out.data.ranges.size())
    notes.push_back(std::to_string(outside) + " of " + std::to_string(out.data.ranges.size()) +
                    " ranges are outside the time of the track, " + to_rfc3339(first->time) + " to " +
                    to_rfc3339(last->time) + "; the first range is at " +
                    to_rfc3339(out.data.ranges.front().time) +
                    ": if they are 18 s apart, one of them is in GPS time");
}

}  // namespace

Needs foreign_needs(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& options) {
  return needs_of(reading_of(track, ranges, options), options.tag);
}

Result<ForeignFlight> foreign_flight(const ForeignTable& track, const ForeignTable& ranges,
                                     const ForeignOptions& options) {
  BOOST_OUTCOME_TRYV(check_columns(track, options.track_columns, "track"));
  BOOST_OUTCOME_TRYV(check_columns(ranges, options.range_columns, "ranges"));
  const Reading reading = reading_of(track, ranges, options);
  std::string unknown;
  for (const auto& need : needs_of(reading, options.tag))
    unknown += (unknown.empty() ? "" : "\n") + words_of(need, track, ranges, reading);
  if (!reading.wrong_unit.empty()) unknown += (unknown.empty() ? "" : "\n") + reading.wrong_unit;
  if (!unknown.empty()) return make_error(Errc::invalid_argument, unknown);
  ForeignFlight out;
  BOOST_OUTCOME_TRY(out.source, source_of(reading, options.max_datum_error_m));
  TrackReader(track, reading, options.epoch_us).read(out);
  BOOST_OUTCOME_TRYV(read_ranges(ranges, reading, options, out));
  if (&track == &ranges) keep_once(out.data.fixes);
  out.data.mission = mission_of(options, out.data.ranges);
  out.data.mission.frame = TrackFrame::local;
  if (!reading.local && !out.source) {
    out.data.mission.frame = TrackFrame::wgs84;
    for (auto& fix : out.data.fixes) {
      fix.frame = TrackFrame::wgs84;
      fix.position = {fix.local_m.y(), fix.local_m.x(), fix.local_m.z()};
      fix.local_m.setZero();
    }
  }
  add_notes(track, ranges, reading, out);
  return out;
}

Result<FlightData> read_foreign_flight(const std::optional<ForeignTable>& track, ForeignTable ranges,
                                       const ForeignOptions& options) {
  if (options.column_for_each_anchor) {
    std::vector<std::string> claimed;
    const auto claim = [&](const ForeignColumns& columns) {
      for (const auto& [field, column] : columns) claimed.push_back(column);
    };
    claim(merged(guessed_range_columns(ranges), options.range_columns));
    if (!track) claim(merged(guessed_track_columns(ranges), options.track_columns));
    const auto anchors = ranges.number_columns(claimed);
    if (anchors.empty())
      return make_error(Errc::invalid_argument,
                        ranges.name() + ": no column of numbers is left for the anchors");
    ranges = std::move(ranges).with_a_row_for_each_range(anchors);
  }
  const ForeignTable& positions = track ? *track : ranges;
  auto read = foreign_flight(positions, ranges, options);
  if (!read) return read.error();
  auto& flight = read.value();
  if (flight.data.fixes.empty() || flight.data.ranges.empty())
    return make_error(Errc::invalid_argument, flight.refused.empty()
                                                  ? "it does not contain a position and a range"
                                                  : flight.refused.front());
  if (flight.source) {
    const auto put = put_on_globe(flight.data, *flight.source, AttitudeOf::true_north);
    if (!put) return make_error(put.error().code, positions.name() + ": " + put.error().message);
  }
  return std::move(flight.data);
}

}  // namespace anchord::api
