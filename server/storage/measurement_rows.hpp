#pragma once

#include "core/ports/measurement_limits.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"
#include "server/storage/cir_file.hpp"
#include "server/storage/sql.hpp"

/// Ranges and fixes as rows: texts, binding, reading, and what "the same content" means.
namespace anchord::sql {

/// What a table of measurements is made of, so that appends and pages are written once for both.
template <class Row>
struct Table;

template <>
struct Table<Range> {
  static constexpr std::string_view name = "uwb_range";
  static constexpr std::string_view id = "range_id";
  static constexpr std::string_view columns =
      "range_id, mission_key, kind, t_ns, received_t_ns, tag, antenna, anchor, seq, distance_m, rss_dbm, "
      "fp_dbm, "
      "rx_dbm, std_noise, heading_deg, truth_distance_m, truth_los";
  static constexpr BulkTable bulk{name,
                                  "mission_key, kind, t_ns, received_t_ns, tag, antenna, anchor, seq, "
                                  "distance_m, rss_dbm, fp_dbm, rx_dbm, "
                                  "std_noise, heading_deg, truth_distance_m, truth_los",
                                  id};
  static constexpr std::string_view same_identity =
      "mission_key = ?1 AND t_ns = ?2 AND tag = ?3 AND anchor = ?4 AND antenna = ?5 AND ifnull(seq, -1) = ?6";
  static void bind(Query& query, std::int64_t mission_key, const Range& row);
  static void bind_identity(Query& query, std::int64_t mission_key, const Range& row);
  /// All columns after id and mission_key; the mission is the caller's to fill in.
  static Range read(Query& query);
  /// Empty, or why the row cannot be stored.
  static std::string refusal(const Range& row);
};

template <>
struct Table<Fix> {
  static constexpr std::string_view name = "fix";
  static constexpr std::string_view id = "fix_id";
  static constexpr std::string_view columns =
      "fix_id, mission_key, t_ns, received_t_ns, seq, frame, lat_deg, lon_deg, height_m, x_m, y_m, z_m, "
      "fix_class, "
      "cov_ee_m2, cov_en_m2, cov_eu_m2, cov_nn_m2, cov_nu_m2, cov_uu_m2, "
      "enu_from_body_x, enu_from_body_y, enu_from_body_z, enu_from_body_w, correction_age_s, satellites";
  static constexpr BulkTable bulk{
      name,
      "mission_key, t_ns, received_t_ns, seq, frame, lat_deg, lon_deg, height_m, x_m, y_m, z_m, fix_class, "
      "cov_ee_m2, cov_en_m2, cov_eu_m2, cov_nn_m2, cov_nu_m2, cov_uu_m2, enu_from_body_x, enu_from_body_y, "
      "enu_from_body_z, enu_from_body_w, correction_age_s, satellites",
      id};
  static constexpr std::string_view same_identity = "mission_key = ?1 AND t_ns = ?2 AND ifnull(seq, -1) = ?3";
  static void bind(Query& query, std::int64_t mission_key, const Fix& row);
  static void bind_identity(Query& query, std::int64_t mission_key, const Fix& row);
  static Fix read(Query& query);
  static std::string refusal(const Fix& row);
};

/// Limits as SQL: `term(text)` gets what compares with the next parameter, `bare(text)` what has none.
/// bind_limits() binds in the same order.
struct LimitColumns {
  std::string_view distance, level, los;
};
template <class Term, class Bare>
void limit_terms(const MeasurementLimits& limits, const LimitColumns& columns, Term term, Bare bare) {
  const auto text = [](std::string_view column, const char* relation) {
    return std::string(column) + relation;
  };
  if (limits.min_distance_m) term(text(columns.distance, " >= "));
  if (limits.max_distance_m) term(text(columns.distance, " <= "));
  if (limits.min_level_dbm) term(text(columns.level, " >= "));
  if (limits.max_level_dbm) term(text(columns.level, " <= "));
  if (limits.label == MeasurementLimits::Label::none) bare(text(columns.los, " IS NULL"));
  if (limits.label == MeasurementLimits::Label::los) bare(text(columns.los, " = 1"));
  if (limits.label == MeasurementLimits::Label::nlos) bare(text(columns.los, " = 0"));
}
void bind_limits(Query& query, const MeasurementLimits& limits);
/// About one row in n, n bound behind it: by a hash of the id (Knuth's multiplier, its upper bits), for each
/// n-th of radios that talk in turn would be always the same one.
inline std::string thinned(std::string_view id) {
  return "0 = ((" + std::string(id) + " & 16777215) * 2654435761 >> 12 & 1048575) % ";
}

/// What a column dt_ps keeps, and what that means; read_cir_columns() knows it.
double stored_dt_ps(const Cir& cir);
double dt_ps_of_stored(double stored);
/// Of a range with this key; the columns of k_cirs.
void bind_cir(Query& query, std::int64_t range_id, const Cir& cir);
inline constexpr BulkTable k_cirs{"cir", "range_id, dt_ps, first_path_idx, preamble_count, re_im"};
/// Of one range: in the database, or only that it is in a file. Neither: it has none.
struct StoredCir {
  std::optional<Cir> cir;
  std::optional<CirDigest> moved;
};
StoredCir read_cir(Connection& connection, std::int64_t range_id);
CirDigest read_digest(Query& query);
/// dt_ps, first_path_idx, preamble_count, re_im.
Cir read_cir_columns(Query& query);

/// Equal in everything but the arrival time, which differs when a client sends again.
bool same_content(const Range& a, const Range& b);
bool same_content(const Fix& a, const Fix& b);

/// Upper triangle of a symmetric matrix: ee, en, eu, nn, nu, uu.
void bind_covariance(Query& query, const Eigen::Matrix3d& m);
Eigen::Matrix3d read_covariance(Query& query);
void bind_wgs84(Query& query, const std::optional<Wgs84>& position);
std::optional<Wgs84> read_wgs84(Query& query);

}  // namespace anchord::sql
