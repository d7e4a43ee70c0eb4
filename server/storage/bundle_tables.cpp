#include "server/storage/bundle_tables.hpp"

#include <algorithm>
#include <array>
#include <span>

#include "core/base/check.hpp"

namespace anchord::sql {
namespace {

/// Columns are "KIND NAME", one after the other: i integer, r real, t text, b bytes, u id; k is the key of a
/// row of the table NAME, which leaves as its id; c is a real of the impulse response beside a range, and cb
/// its bytes; lr is a real that came later (BundleColumn::later). "mission" among the columns is the flight
/// itself. Keys ending in ? may be NULL; a name ending in + came later (BundleTable::later).
struct Line {
  BundlePart part;
  const char* name;
  const char* columns;
  const char* keys;
  const char* where;
  const char* order;
};

constexpr const char* k_of_flight = "t.mission_key = ?1";
constexpr const char* k_of_exclusions =
    "t.exclusion_key IN (SELECT e.exclusion_key FROM exclusion e WHERE e.mission_key = ?1)";
constexpr const char* k_of_calibrations =
    "t.calibration_key IN (SELECT c.calibration_key FROM calibration_mission c WHERE c.mission_key = ?1)";
constexpr const char* k_of_revisions =
    "t.number IN (SELECT r.number FROM revision r JOIN calibration_mission c ON c.calibration_key = "
    "r.calibration_key WHERE c.mission_key = ?1)";
constexpr const char* k_of_anchors =
    "t.network_id IN (SELECT d.network_id FROM device_seen d WHERE d.mission_key = ?1 AND d.kind = 1)";

constexpr const char* k_bundle_site_columns =
    "u id t name r origin_lat_deg r origin_lon_deg r origin_height_m t outline_geojson t crs_frame "
    "r crs_epoch_year r base_sigma_m t base_source i created_t_ns i version i projected_epsg";
constexpr const char* k_bundle_frame_columns =
    "u id t name u site_id t definition_json i created_t_ns i version";
constexpr const char* k_bundle_plan_columns =
    "u id t name u site_id t document_json i created_t_ns i changed_t_ns i version";
constexpr const char* k_bundle_anchor_columns =
    "u id i network_id u site_id t name t building t floor t space t asset_tag t ifc_guid i retired "
    "i created_t_ns i version";
constexpr const char* k_external_id_columns = "u anchor_id i ordinal t system t external_id";

constexpr std::array k_lines{
    Line{BundlePart::site, "site", k_bundle_site_columns, "id", "t.id = ?1", "t.id"},
    Line{BundlePart::site, "local_frame", k_bundle_frame_columns, "id", "t.site_id = ?1", "t.id"},
    Line{BundlePart::shared, "kit_profile", "t kit i version i t_ns t changed_by t source t profile_json",
         "kit version", "t.kit = (SELECT m.kit FROM mission m WHERE m.mission_key = ?1)", "t.version"},
    Line{BundlePart::plan, "plan", k_bundle_plan_columns, "id", "t.id = ?1", "t.id"},
    Line{BundlePart::shared, "anchor", k_bundle_anchor_columns, "network_id", k_of_anchors, "t.network_id"},
    Line{BundlePart::shared, "anchor_external_id", k_external_id_columns, "anchor_id ordinal",
         "t.anchor_id IN (SELECT a.id FROM anchor a JOIN device_seen d ON d.network_id = a.network_id WHERE "
         "d.mission_key = ?1 AND d.kind = 1)",
         "t.anchor_id, t.ordinal"},
    Line{BundlePart::mission, "mission",
         "u id u site_id t name t kit t radio i frame i track_point i state i created_t_ns i finished_t_ns "
         "lr lever_arm_sigma_m",
         "id", k_of_flight, "t.mission_key"},
    Line{BundlePart::declared, "mission_tag",
         "mission i ordinal i tag i antenna r lever_arm_forward_m r lever_arm_left_m r lever_arm_up_m",
         "ordinal", k_of_flight, "t.ordinal"},
    Line{BundlePart::noted, "mission_procedure", "mission t state_json i changed_t_ns", "", k_of_flight,
         "t.mission_key"},
    Line{BundlePart::noted, "procedure_log+", "mission i number i t_ns t topic t message_json", "number",
         k_of_flight, "t.number"},
    Line{BundlePart::measured, "uwb_range",
         "mission i kind i t_ns i received_t_ns i tag i antenna i anchor i seq r distance_m r rss_dbm "
         "r fp_dbm r rx_dbm r std_noise r heading_deg r truth_distance_m i truth_los c dt_ps "
         "c first_path_idx c preamble_count cb re_im",
         "t_ns tag anchor antenna seq?", k_of_flight, "t.range_id"},
    Line{BundlePart::measured, "fix",
         "mission i t_ns i received_t_ns i seq i frame r lat_deg r lon_deg r height_m r x_m r y_m r z_m "
         "i fix_class r cov_ee_m2 r cov_en_m2 r cov_eu_m2 r cov_nn_m2 r cov_nu_m2 r cov_uu_m2 "
         "r enu_from_body_x r enu_from_body_y r enu_from_body_z r enu_from_body_w r correction_age_s "
         "i satellites",
         "t_ns seq?", k_of_flight, "t.fix_id"},
    Line{BundlePart::counted, "device_seen",
         "mission i network_id i kind i first_t_ns i last_t_ns i n_ranges", "network_id kind", k_of_flight,
         "t.network_id, t.kind"},
    Line{BundlePart::own, "exclusion",
         "u id mission i kind i since_t_ns i until_t_ns i anchor i tag i n_rows t reason i created_t_ns "
         "t created_by",
         "id", k_of_flight, "t.exclusion_key"},
    Line{BundlePart::own, "exclusion_row", "k exclusion i t_ns i tag i anchor i antenna",
         "exclusion_id t_ns tag anchor antenna", k_of_exclusions,
         "t.exclusion_key, t.t_ns, t.tag, t.anchor, t.antenna"},
    Line{BundlePart::noted, "exclusion_taken_back", "k exclusion t reason i t_ns t taken_back_by",
         "exclusion_id", k_of_exclusions, "t.exclusion_key"},
    Line{BundlePart::model, "model",
         "u id t task t method t sha256_hex t manifest_json i created_t_ns t created_by", "id", "t.id = ?1",
         "t.id"},
    Line{BundlePart::model, "model_artifact", "k model t json", "model_id",
         "t.model_key = (SELECT m.model_key FROM model m WHERE m.id = ?1)", "t.model_key"},
    Line{BundlePart::calibration, "calibration",
         "u id i frame r origin_lat_deg r origin_lon_deg r origin_height_m t settings_json i created_t_ns "
         "t provenance_json",
         "id", k_of_calibrations, "t.calibration_key"},
    Line{BundlePart::calibration, "calibration_mission", "k calibration i ordinal k mission",
         "calibration_id ordinal", k_of_calibrations, "t.calibration_key, t.ordinal"},
    Line{BundlePart::calibration, "estimate",
         "k calibration i network_id i ordinal i t_ns i verdict t reason r h95_m r v95_m r gdop r gdop_trace "
         "i n_used r bias_m r bias_sigma_m r lag_s r lag_sigma_s",
         "calibration_id network_id", k_of_calibrations, "t.calibration_key, t.ordinal"},
    Line{
        BundlePart::calibration, "hypothesis",
        "k calibration i network_id i is_mirror r e_m r n_m r u_m r lat_deg r lon_deg r height_m r cov_ee_m2 "
        "r cov_en_m2 r cov_eu_m2 r cov_nn_m2 r cov_nu_m2 r cov_uu_m2 r rms_residual_m r probability",
        "calibration_id network_id is_mirror", k_of_calibrations,
        "t.calibration_key, t.network_id, t.is_mirror"},
    Line{BundlePart::calibration, "estimate_refused", "k calibration i network_id t reason i n_ranges",
         "calibration_id network_id reason", k_of_calibrations, "t.calibration_key, t.network_id, t.reason"},
    Line{BundlePart::calibration, "estimate_gate",
         "k calibration i network_id i ordinal t name r value r limit_value i passed t why",
         "calibration_id network_id ordinal", k_of_calibrations,
         "t.calibration_key, t.network_id, t.ordinal"},
    Line{BundlePart::calibration, "calibration_evidence", "k calibration t evidence_json", "calibration_id",
         k_of_calibrations, "t.calibration_key"},
    Line{BundlePart::revision, "revision", "i number k calibration i published_t_ns t published_by t note",
         "number", k_of_revisions, "t.number"},
    Line{BundlePart::revision, "revision_position", "i number i network_id i since_number",
         "number network_id", k_of_revisions, "t.number, t.network_id"},
    Line{BundlePart::revision, "revision_override", "i number i network_id t reason t overridden_by",
         "number network_id", k_of_revisions, "t.number, t.network_id"},
};

constexpr const char* k_of_buildings = "t.building_id IN (SELECT b.id FROM building b WHERE b.site_id = ?1)";
/// Pictures that a floor names; those that are being written are nobody's yet.
constexpr const char* k_of_floors =
    "t.named = 1 AND t.floor_id IN (SELECT f.id FROM building_floor f JOIN building b ON b.id = "
    "f.building_id WHERE b.site_id = ?1)";
constexpr const char* k_of_images =
    "t.image_id IN (SELECT i.id FROM plan_image i JOIN building_floor f ON f.id = i.floor_id JOIN building b "
    "ON b.id = f.building_id WHERE i.named = 1 AND b.site_id = ?1)";
constexpr const char* k_of_tiles =
    "t.tiles_id IN (SELECT i.id FROM plan_tiles i JOIN building_floor f ON f.id = i.floor_id JOIN building b "
    "ON b.id = f.building_id WHERE i.named = 1 AND b.site_id = ?1)";
/// Of a site, beside its flights: ?1 is the site.
constexpr std::array k_site_lines{
    Line{BundlePart::site, "site", k_bundle_site_columns, "id", "t.id = ?1", "t.id"},
    Line{BundlePart::site, "local_frame", k_bundle_frame_columns, "id", "t.site_id = ?1", "t.id"},
    Line{BundlePart::plan, "plan", k_bundle_plan_columns, "id", "t.site_id = ?1", "t.id"},
    Line{BundlePart::shared, "anchor", k_bundle_anchor_columns, "network_id", "t.site_id = ?1",
         "t.network_id"},
    Line{BundlePart::shared, "anchor_external_id", k_external_id_columns, "anchor_id ordinal",
         "t.anchor_id IN (SELECT a.id FROM anchor a WHERE a.site_id = ?1)", "t.anchor_id, t.ordinal"},
    Line{BundlePart::site, "building+", "u id u site_id t name r height_m i created_t_ns i version", "id",
         "t.site_id = ?1", "t.id"},
    Line{BundlePart::site, "building_floor+",
         "u id u building_id t name r level r base_height_m t georeference t proposal t structure "
         "i created_t_ns i version",
         "id", k_of_buildings, "t.id"},
    Line{BundlePart::site, "plan_image+",
         "u id u floor_id i kind i named t media_type i width_px i height_px i bytes t sha256", "id",
         k_of_floors, "t.id"},
    Line{BundlePart::site, "plan_image_part+", "u image_id i ordinal b content", "image_id ordinal",
         k_of_images, "t.image_id, t.ordinal"},
    Line{BundlePart::site, "plan_tiles+",
         "u id u floor_id i named i n_levels r m_per_px i width_px i height_px r west_m r north_m i bytes "
         "t sha256",
         "id", k_of_floors, "t.id"},
    Line{BundlePart::site, "plan_tile+", "u tiles_id i level i tile_column i tile_row b content",
         "tiles_id level tile_column tile_row", k_of_tiles, "t.tiles_id, t.level, t.tile_column, t.tile_row"},
};

std::vector<std::string> words(std::string_view text) {
  std::vector<std::string> out;
  while (!text.empty()) {
    const auto end = std::min(text.find(' '), text.size());
    if (end > 0) out.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

CellKind kind_of(const std::string& letter) {
  if (letter == "i") return CellKind::integer;
  if (letter == "r" || letter == "lr" || letter == "c") return CellKind::real;
  if (letter == "b" || letter == "cb") return CellKind::bytes;
  if (letter == "u" || letter == "k") return CellKind::id;
  ANCHORD_CHECK(letter == "t", "no kind of column: " << letter);
  return CellKind::text;
}

/// The key of a row of another table, for the id that is parameter n.
std::string key_of(const std::string& parent, std::size_t n) {
  return "(SELECT p." + parent + "_key FROM " + parent + " p WHERE p.id = ?" + std::to_string(n) + ')';
}

void read_columns(const Line& line, BundleSpec& spec) {
  const auto all = words(line.columns);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i] == "mission") {
      spec.of_mission = true;
      continue;
    }
    const std::string& letter = all[i];
    const std::string name = all.at(++i);
    BundleColumnSql column{name, name, "t." + name, ""};
    if (letter == "k") {
      column = {name + "_id", name + "_key",
                "(SELECT p.id FROM " + name + " p WHERE p." + name + "_key = t." + name + "_key)", name};
    } else if (letter == "c" || letter == "cb") {
      column = {name, "", "c." + name, ""};
    }
    spec.table.columns.push_back({column.bundle, kind_of(letter), letter == "lr"});
    spec.columns.push_back(std::move(column));
  }
}

void read_keys(const Line& line, BundleSpec& spec) {
  for (std::string key : words(line.keys)) {
    const bool nullable = key.back() == '?';
    if (nullable) key.pop_back();
    const auto at = std::ranges::find(spec.columns, key, &BundleColumnSql::bundle);
    ANCHORD_CHECK(at != spec.columns.end(), line.name << " has no column " << key);
    if (nullable) spec.nullable.push_back(key);
    spec.keys.push_back(static_cast<std::size_t>(at - spec.columns.begin()));
  }
}

std::string find_text(const BundleSpec& spec, const std::string& head) {
  std::string text = head + " WHERE ";
  std::size_t n = 0;
  if (spec.of_mission) text += "t.mission_key = ?" + std::to_string(++n);
  for (const std::size_t key : spec.keys) {
    const BundleColumnSql& column = spec.columns[key];
    const bool nullable = std::ranges::count(spec.nullable, column.bundle) > 0;
    text += n > 0 ? " AND " : "";
    ++n;
    if (!column.parent.empty())
      text += "t." + column.column + " = " + key_of(column.parent, n);
    else if (nullable)  // as the index of the identity has it
      text += "ifnull(t." + column.column + ", -1) = ?" + std::to_string(n);
    else
      text += "t." + column.column + " = ?" + std::to_string(n);
  }
  return text;
}

std::string insert_text(const BundleSpec& spec) {
  std::string names = spec.of_mission ? "mission_key" : "", values = spec.of_mission ? "?1" : "";
  std::size_t n = spec.of_mission ? 1 : 0;
  for (const auto& column : spec.columns) {
    if (column.column.empty()) continue;
    ++n;
    names += (names.empty() ? "" : ", ") + column.column;
    values += values.empty() ? "" : ", ";
    values += column.parent.empty() ? '?' + std::to_string(n) : key_of(column.parent, n);
  }
  return "INSERT INTO " + spec.table.name + " (" + names + ") VALUES (" + values + ')';
}

BundleSpec spec_of(const Line& line) {
  BundleSpec spec;
  spec.part = line.part;
  spec.table.name = line.name;
  if (spec.table.later = spec.table.name.ends_with('+'); spec.table.later) spec.table.name.pop_back();
  read_columns(line, spec);
  read_keys(line, spec);
  std::string head = "SELECT ";
  for (std::size_t i = 0; i < spec.columns.size(); ++i) {
    head += (i > 0 ? ", " : "") + spec.columns[i].select;
    spec.with_cir = spec.with_cir || spec.columns[i].column.empty();
  }
  head += (spec.with_cir ? ", v.digest FROM " : " FROM ") + spec.table.name + " t";
  if (spec.with_cir)
    head += " LEFT JOIN cir c ON c.range_id = t.range_id LEFT JOIN cir_moved v ON v.range_id = t.range_id";
  spec.select = head + " WHERE " + line.where + " ORDER BY " + line.order;
  spec.find = find_text(spec, head);
  spec.insert = insert_text(spec);
  if (spec.of_mission) spec.count = "SELECT count(*) FROM " + spec.table.name + " WHERE mission_key = ?1";
  return spec;
}

std::vector<BundleSpec> specs_of(std::span<const Line> lines) {
  std::vector<BundleSpec> all;
  for (const Line& line : lines) all.push_back(spec_of(line));
  return all;
}

}  // namespace

const std::vector<BundleSpec>& bundle_specs() {
  static const std::vector<BundleSpec> specs = specs_of(k_lines);
  return specs;
}

const std::vector<BundleSpec>& site_bundle_specs() {
  static const std::vector<BundleSpec> specs = specs_of(k_site_lines);
  return specs;
}

}  // namespace anchord::sql
