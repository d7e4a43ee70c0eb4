#include "api/formats/foreign_flight.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "api/formats/foreign_reading.hpp"
#include "api/formats/foreign_tags.hpp"
#include "api/formats/foreign_values.hpp"
#include "api/formats/globe_track.hpp"
#include "api/wire/row_limits.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

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
std::string no_number(std::string_view cell) {
  return '"' + to_utf8(cell, 40) + "\" is not a number that can be read";
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
    const Eigen::Vector3d at(*x / per_degree, *y / per_degree, *z / reading_.height_per_metre);
    const Eigen::Vector3d up = reading_.local ? enu_of(at, *reading_.axes, named_east_) : at;
    return Eigen::Vector3d(up.x(), up.y(), up.z() + *geoid);
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
    if (x && y && z && w) {
      const auto attitude = row_limits::rotation_of({*x, *y, *z, *w});
      if (attitude) fix.enu_from_body = enu_attitude(*attitude, *reading_.axes);
    } else if (const auto to = heading_.number(row))
      fix.enu_from_body = row_limits::rotation_of_heading(north_deg(*to, *reading_.heading));
  }

  const ForeignTable& table_;
  const Reading& reading_;
  std::int64_t epoch_us_;
  Cells cells_;
  bool own_frame_{};
  bool named_east_ = is_east(column_of(reading_.tc, "x"));
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
                         const TagArms& arms, ForeignFlight& out) {
  const Cells cells(table, reading.rc);
  const auto time = cells("time"), zone = cells("zone"), distance = cells("range"), anchor = cells("anchor"),
             tag = cells("tag"), kind = cells("kind"), rss = cells("rss"), rx = cells("rx"), fp = cells("fp"),
             seq = cells("seq"), antenna = cells("antenna");
  std::map<NetworkId, std::string> names;  // of anchors that have a name alone
  std::size_t n_turned = 0;
  const auto is_tag = [&](const std::string& text) {
    return !arms.empty() && arms.contains(foreign_id(text, *reading.addresses).id);
  };
  for (std::size_t row = 0; row < table.n_rows(); ++row) {
    const auto moment = time_text(row, time, zone, reading.range_time);
    const auto us = time_us(table, moment, reading.range_time, o.epoch_us);
    const auto metres = distance.number(row);
    std::string who(anchor.text(row)), of(tag.text(row).empty() ? o.tag : tag.text(row));
    const bool to_tag = is_tag(who);
    if (to_tag && !is_tag(of)) {
      std::swap(who, of);
      ++n_turned;
    }
    const std::string wrong = to_tag && is_tag(who)        ? "a range between two tags"
                              : of.empty()                 ? "no tag"
                              : who.empty()                ? "no anchor"
                              : !us                        ? no_time(moment)
                              : distance.text(row).empty() ? "no range"
                              : !metres                    ? no_number(distance.text(row))
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
  if (n_turned > 0)
    out.data.notes.push_back(table.name() + ": " + std::to_string(n_turned) +
                             " ranges were begun by the anchor: tag and anchor are exchanged in them");
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

Mission mission_of(const ForeignOptions& o, const TagArms& arms, const std::vector<Range>& ranges) {
  Mission mission;
  mission.name = o.name.empty() ? "Imported flight" : o.name;
  mission.kit = o.kit;
  mission.point = o.point;
  mission.lever_arm_sigma_m = o.lever_arm_sigma_m;
  mission.state = MissionState::finished;
  std::set<std::pair<NetworkId, std::uint8_t>> seen;
  for (const auto& range : ranges) {
    if (range.kind == RangeKind::tag_anchor && seen.emplace(range.tag, range.antenna).second)
      mission.tags.push_back(
          {range.tag, range.antenna, arms.contains(range.tag) ? arms.at(range.tag) : o.lever_arm_body_m});
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
  if (r.axes == TrackAxes::ned)
    notes.push_back(
        track.name() + ": '" + std::string(column_of(r.tc, "z")) + "' counts downwards" +
        (is_east(column_of(r.tc, "x")) ? "" : ", x is north and y east") +
        ": the track is changed to east, north, up, and so are the anchors; --track-axes enu if z "
        "counts upwards");
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
                    ": if they are 18 s apart, one of them is in GPS time; --track-time and --range-time say "
                    "unit and clock (s, ms, us, ns; utc, gps), --column track.time=NAME another column");
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
  if (!reading.contradiction.empty()) unknown += (unknown.empty() ? "" : "\n") + reading.contradiction;
  if (!unknown.empty()) return make_error(Errc::invalid_argument, unknown);
  ForeignFlight out;
  BOOST_OUTCOME_TRY(out.source, source_of(reading, options.max_datum_error_m));
  TrackReader(track, reading, options.epoch_us).read(out);
  BOOST_OUTCOME_TRY(const auto arms, arms_of(options, *reading.addresses));
  BOOST_OUTCOME_TRYV(read_ranges(ranges, reading, options, arms, out));
  BOOST_OUTCOME_TRYV(check_arms(arms, options, out.data.ranges));
  note_tags(ranges.name(), arms, out.data.ranges, out.data.notes);
  if (&track == &ranges) keep_once(out.data.fixes);
  out.data.mission = mission_of(options, arms, out.data.ranges);
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
