#include "api/bundles/bundle_values.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

#include "api/kit/reader.hpp"
#include "api/planning/plan_json.hpp"
#include "api/wire/row_limits.hpp"
#include "core/base/check.hpp"
#include "core/base/line_text.hpp"
#include "core/types/estimate.hpp"
#include "core/types/exclusion.hpp"
#include "core/types/fix.hpp"
#include "core/types/geo_rings.hpp"
#include "core/types/mission.hpp"
#include "core/types/place.hpp"
#include "core/types/range.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

constexpr std::size_t k_cir_cells = 4;
/// Of rows that a device of the server sent, which passed its driver: a Pozyx radio tells up to a kilometre,
/// levels are computed from impulse responses, and a receiver without a fix says that it is off by thousands
/// of kilometres, or by nothing.
constexpr Bounds k_stored_distance_m{0.001, 1000}, k_stored_dbm{-400, 50},
    k_stored_covariance_m2{-1e14, 1e14};
constexpr double k_any_m = std::numeric_limits<double>::max();

/// Which columns a rule is for: of one table, or ("") of all; "*" before a column: that end in it.
struct Where {
  std::string_view table, column;
  bool has(std::string_view of, std::string_view name) const {
    if (!table.empty() && table != of) return false;
    return column.starts_with('*') ? name.ends_with(column.substr(1)) : name == column;
  }
};
struct TextRule {
  Where where;
  std::size_t most_characters;
  bool required;
};
struct RealRule {
  Where where;
  Bounds bounds;
};
struct WholeRule {
  Where where;
  WholeBounds bounds;
};

// The first rule that a column has holds.
constexpr std::array k_texts{
    TextRule{{"site", "name"}, record_limits::k_name, true},
    TextRule{{"mission", "name"}, record_limits::k_name, true},
    TextRule{{"plan", "name"}, record_limits::k_name, true},
    TextRule{{"building", "name"}, record_limits::k_name, true},
    TextRule{{"building_floor", "name"}, record_limits::k_name, true},
    TextRule{{"local_frame", "name"}, record_limits::k_frame_name, true},
    TextRule{{"anchor_external_id", "system"}, record_limits::k_external_system, true},
    TextRule{{"anchor_external_id", "external_id"}, record_limits::k_name, true},
    TextRule{{"exclusion", "reason"}, record_limits::k_reason, true},
    TextRule{{"exclusion_taken_back", "reason"}, record_limits::k_reason, false},
    TextRule{{"revision_override", "reason"}, record_limits::k_reason, true},
    TextRule{{"revision", "note"}, record_limits::k_note, false},
    TextRule{{"", "kit"}, record_limits::k_name, false},
    TextRule{{"mission", "radio"}, record_limits::k_name, false},
    TextRule{{"site", "*"}, record_limits::k_name, false},
    TextRule{{"anchor", "*"}, record_limits::k_name, false},
    TextRule{{"", "*"}, record_limits::k_words, false}};

constexpr std::array k_reals{
    RealRule{{"", "*lat_deg"}, row_limits::k_lat_deg},
    RealRule{{"", "*lon_deg"}, row_limits::k_lon_deg},
    RealRule{{"", "*origin_height_m"}, row_limits::k_height_m},
    RealRule{{"site", "crs_epoch_year"}, record_limits::k_crs_epoch_year},
    RealRule{{"site", "base_sigma_m"}, record_limits::k_base_sigma_m},
    RealRule{{"mission_tag", "*"}, record_limits::k_lever_arm_m},
    RealRule{{"building", "height_m"}, record_limits::k_building_height_m},
    RealRule{{"building_floor", "level"}, record_limits::k_floor_level},
    RealRule{{"building_floor", "base_height_m"}, record_limits::k_floor_base_m},
    RealRule{{"plan_tiles", "m_per_px"}, {0, k_any_m}},
    RealRule{{"uwb_range", "distance_m"}, k_stored_distance_m},
    RealRule{{"uwb_range", "*_dbm"}, k_stored_dbm},
    RealRule{{"uwb_range", "std_noise"}, row_limits::k_std_noise},
    RealRule{{"uwb_range", "heading_deg"}, row_limits::k_heading_deg},
    RealRule{{"uwb_range", "truth_distance_m"}, row_limits::k_truth_distance_m},
    RealRule{{"uwb_range", "first_path_idx"}, row_limits::k_cir_first_path},
    RealRule{{"uwb_range", "preamble_count"}, row_limits::k_cir_preamble},
    RealRule{{"fix", "height_m"}, row_limits::k_height_m},
    RealRule{{"fix", "*_m"}, row_limits::k_local_m},
    RealRule{{"fix", "*_m2"}, k_stored_covariance_m2},
    RealRule{{"fix", "correction_age_s"}, row_limits::k_correction_age_s},
    RealRule{{"estimate", "h95_m"}, {0, k_any_m}},
    RealRule{{"estimate", "v95_m"}, {0, k_any_m}},
    RealRule{{"estimate", "gdop"}, {0, k_any_m}},
    RealRule{{"estimate", "gdop_trace"}, {0, k_any_m}},
    RealRule{{"estimate", "*_sigma_m"}, {0, k_any_m}},
    RealRule{{"estimate", "*_sigma_s"}, {0, k_any_m}},
    RealRule{{"hypothesis", "rms_residual_m"}, {0, k_any_m}},
    RealRule{{"hypothesis", "probability"}, {0, 1}},
};

constexpr WholeBounds k_network_id{0, UINT32_MAX}, k_from_0{0, INT64_MAX}, k_from_1{1, INT64_MAX},
    k_yes_or_no{0, 1};
constexpr WholeBounds k_measured_t_ns{row_limits::k_t_us.min * 1000, row_limits::k_t_us.max * 1000};
template <class Table>
constexpr WholeBounds of(const Table&) {
  return {0, static_cast<std::int64_t>(Table::size()) - 1};
}

constexpr std::array k_wholes{
    WholeRule{{"", "network_id"}, k_network_id},
    WholeRule{{"", "tag"}, k_network_id},
    WholeRule{{"", "anchor"}, k_network_id},
    WholeRule{{"", "antenna"}, row_limits::k_antenna},
    WholeRule{{"uwb_range", "*t_ns"}, k_measured_t_ns},
    WholeRule{{"fix", "*t_ns"}, k_measured_t_ns},
    WholeRule{{"", "*t_ns"}, {0, record_limits::k_latest_us * 1000}},
    WholeRule{{"", "seq"}, row_limits::k_seq},
    WholeRule{{"", "version"}, k_from_1},
    WholeRule{{"", "frame"}, of(k_frame_words)},
    WholeRule{{"mission", "track_point"}, of(k_point_words)},
    WholeRule{{"mission", "state"}, of(k_mission_state_words)},
    WholeRule{{"uwb_range", "kind"}, of(k_range_kind_words)},
    WholeRule{{"exclusion", "kind"}, of(k_row_kind_words)},
    WholeRule{{"plan_image", "kind"}, of(k_image_kind_words)},
    WholeRule{{"device_seen", "kind"}, k_yes_or_no},
    WholeRule{{"fix", "fix_class"}, of(k_fix_words)},
    WholeRule{{"fix", "satellites"}, row_limits::k_satellites},
    WholeRule{{"estimate", "verdict"}, of(k_verdict_words)},
    WholeRule{{"site", "projected_epsg"}, record_limits::k_epsg},
    WholeRule{{"anchor", "retired"}, k_yes_or_no},
    WholeRule{{"uwb_range", "truth_los"}, k_yes_or_no},
    WholeRule{{"", "is_mirror"}, k_yes_or_no},
    WholeRule{{"", "passed"}, k_yes_or_no},
    WholeRule{{"", "named"}, k_yes_or_no},
    WholeRule{{"", "*"}, k_from_0},  // ordinals, counts, pixels, numbers
};

template <class Rules>
const auto& rule_of(const Rules& rules, const BundleTable& table, const BundleColumn& column) {
  return *std::ranges::find_if(rules, [&](const auto& r) { return r.where.has(table.name, column.name); });
}

std::string in_words(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

std::string number_fault(const std::optional<Bounds>& bounds, double value) {
  if (!std::isfinite(value)) return "is not a number";
  if (!bounds || bounds->hold(value)) return {};
  if (bounds->max == k_any_m) return "is less than " + in_words(bounds->min);
  return "is not within " + in_words(bounds->min) + " and " + in_words(bounds->max);
}

std::string whole_fault(const WholeBounds& bounds, std::int64_t value) {
  if (bounds.hold(value)) return {};
  if (bounds.max == INT64_MAX) return "is not " + std::to_string(bounds.min) + " or more";
  return "is not within " + std::to_string(bounds.min) + " and " + std::to_string(bounds.max);
}

/// Empty documents are there where nothing was to be said.
std::string document_fault(const std::string& text, bool plan, Json& document) {
  if (text.empty() && !plan) return {};
  if (const auto wrong = parse_json(text, document)) return "is not JSON that can be read: " + wrong->detail;
  if (!document.is_structured()) return "is neither an object nor an array";
  if (!plan) return {};
  std::vector<FieldError> errors;
  (void)read_plan(document, errors);
  if (errors.empty()) return {};
  const auto& first = errors.front();
  return "is no plan that this version can read: " + (first.pointer.empty() ? "" : first.pointer + ": ") +
         first.detail;
}

std::string outline_fault(const std::string& text, const Json& outline) {
  std::string wrong;
  if (text.size() > record_limits::k_outline_bytes)
    return "has more than " + std::to_string(record_limits::k_outline_bytes) + " bytes";
  if (text.empty() || rings_of(outline, wrong)) return {};
  return "is no GeoJSON Polygon" + (wrong.empty() ? "" : ": " + wrong);
}

bool given(const BundleCell& cell) { return !std::holds_alternative<std::monostate>(cell); }
std::size_t n_given(const BundleRow& row, std::size_t from, std::size_t n) {
  std::size_t count = 0;
  for (std::size_t i = from; i < from + n; ++i) count += given(row[i]) ? 1 : 0;
  return count;
}
double real_of(const BundleCell& cell) {
  const auto* real = std::get_if<double>(&cell);
  return real != nullptr ? *real : 0;
}
template <std::size_t N>
std::array<double, N> reals_of(const BundleRow& row, std::size_t from) {
  std::array<double, N> out{};
  for (std::size_t i = 0; i < N; ++i) out[i] = real_of(row[from + i]);
  return out;
}

/// Of [ee, en, eu, nn, nu, uu]: a device may say 0, and rounding may cost what makes it definite, but no
/// variance is negative and nothing is more than wholly correlated.
bool is_covariance(const std::array<double, 6>& c) {
  constexpr double k_rounding = 1 + 1e-6;
  const auto correlated = [](double ab, double aa, double bb) { return ab * ab <= aa * bb * k_rounding; };
  return c[0] >= 0 && c[3] >= 0 && c[5] >= 0 && correlated(c[1], c[0], c[3]) &&
         correlated(c[2], c[0], c[5]) && correlated(c[4], c[3], c[5]);
}

}  // namespace

RowCheck::RowCheck(const BundleTable& table)
    : table_(table), of_fixes_(table.name == "fix"), of_ranges_(table.name == "uwb_range") {
  for (const auto& named : table.columns) {
    auto& column = columns_.emplace_back();
    const auto& text = rule_of(k_texts, table, named);
    column.most_characters = text.most_characters;
    column.required = text.required;
    column.whole = rule_of(k_wholes, table, named).bounds;
    for (const auto& rule : k_reals)
      if (rule.where.has(table.name, named.name) && !column.real) column.real = rule.bounds;
    const bool of_floor = table.name == "building_floor" && named.name != "name";
    if (named.name.ends_with("_json") || of_floor)
      column.document = table.name == "plan" ? Document::plan : Document::any;
    else if (named.name == "outline_geojson")
      column.document = Document::outline;
    else if (named.name == "json")
      column.document = Document::kept;  // an artifact, which the registry of models reads
  }
}

std::size_t RowCheck::at(const char* column) const {
  const auto found = std::ranges::find(table_.columns, column, &BundleColumn::name);
  ANCHORD_CHECK(found != table_.columns.end(), table_.name << " has no column " << column);
  return static_cast<std::size_t>(found - table_.columns.begin());
}

std::string RowCheck::text_fault(const Column& column, const std::string& text) const {
  if (text.find('\0') != std::string::npos) return "has a character 0";
  if (column.document == Document::kept) return {};
  if (column.document != Document::none) {
    Json document;
    auto fault = document_fault(text, column.document == Document::plan, document);
    return fault.empty() && column.document == Document::outline ? outline_fault(text, document) : fault;
  }
  if (column.required && is_blank(text)) return "must not be empty";
  return anchord::in_words(line_fault(text, column.most_characters), column.most_characters);
}

std::string RowCheck::cell_fault(const Column& column, const BundleCell& cell) const {
  if (const auto* number = std::get_if<double>(&cell)) return number_fault(column.real, *number);
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return whole_fault(*column.whole, *whole);
  return {};
}

std::string RowCheck::fix_fault(const BundleRow& row) const {
  const std::size_t globe = at("lat_deg"), local = at("x_m"), covariance = at("cov_ee_m2"),
                    rotation = at("enu_from_body_x");
  const auto* frame = std::get_if<std::int64_t>(&row[at("frame")]);
  const bool is_local = frame != nullptr && *frame == static_cast<std::int64_t>(TrackFrame::local);
  if (n_given(row, is_local ? local : globe, 3) != 3)
    return is_local ? "x_m, y_m, z_m are not all there" : "lat_deg, lon_deg, height_m are not all there";
  if (n_given(row, is_local ? globe : local, 3) != 0)
    return "has a position on the globe and a local one, of which frame says that there is one";
  if (!is_local && row_limits::null_island(real_of(row[globe + 1]), real_of(row[globe])))
    return "lat_deg and lon_deg are both 0: a receiver sends this when it has no fix";
  const std::size_t n_covariance = n_given(row, covariance, 6), n_rotation = n_given(row, rotation, 4);
  if (n_covariance != 0 && (n_covariance != 6 || !is_covariance(reals_of<6>(row, covariance))))
    return "cov_ee_m2 to cov_uu_m2 are no covariance";
  if (n_rotation != 0 && (n_rotation != 4 || !row_limits::rotation_of(reals_of<4>(row, rotation))))
    return "enu_from_body_x to enu_from_body_w are no unit quaternion";
  return {};
}

std::string RowCheck::range_fault(const BundleRow& row) const {
  const auto& tag = row[at("tag")];
  if (tag == row[at("anchor")] && tag != BundleCell{std::int64_t{0}})
    return "tag and anchor are the same: a radio cannot measure the distance to itself";
  const std::size_t cir = row.size() - k_cir_cells;
  if (n_given(row, cir, k_cir_cells) == 0) return {};
  const auto* samples = std::get_if<std::string>(&row.back());
  if (samples == nullptr || !given(row[cir])) return "dt_ps and re_im are not both there";
  const double dt_ps = real_of(row[cir]);  // 0: the usual one
  if (dt_ps != 0 && !row_limits::k_cir_dt_ps.hold(dt_ps))
    return "dt_ps " + number_fault(row_limits::k_cir_dt_ps, dt_ps);
  if (samples->size() % 4 != 0 ||
      !row_limits::k_cir_taps.hold(static_cast<std::int64_t>(samples->size() / 4)))
    return "re_im are not 1 to " + std::to_string(row_limits::k_cir_taps.max) + " samples of 4 bytes";
  return {};
}

std::string RowCheck::fault_of(const BundleRow& row) const {
  for (std::size_t i = 0; i < row.size(); ++i) {
    const auto& named = table_.columns[i];
    const auto* text = std::get_if<std::string>(&row[i]);
    const auto fault = text != nullptr && named.kind == CellKind::text ? text_fault(columns_[i], *text)
                                                                       : cell_fault(columns_[i], row[i]);
    if (!fault.empty()) return named.name + ' ' + fault;
    const bool source = text != nullptr && named.name == "base_source" && !text->empty();
    if (source &&
        std::ranges::find(record_limits::k_base_sources, *text) == record_limits::k_base_sources.end())
      return "base_source is not one of known_point, survey_in, network";
    const auto* sigma_m = named.name == "lever_arm_sigma_m" ? std::get_if<double>(&row[i]) : nullptr;
    if (sigma_m != nullptr && !is_lever_arm_sigma(*sigma_m)) return named.name + ' ' + k_lever_arm_sigma_rule;
    if (named.name == "state" && row[i] != BundleCell{static_cast<std::int64_t>(MissionState::finished)})
      return "state is not that of a finished flight";
  }
  return of_fixes_ ? fix_fault(row) : of_ranges_ ? range_fault(row) : "";
}

}  // namespace anchord::api
