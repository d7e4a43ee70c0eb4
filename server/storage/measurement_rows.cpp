#include "server/storage/measurement_rows.hpp"

#include <bit>
#include <cmath>
#include <cstring>

namespace anchord::sql {
namespace {

static_assert(std::endian::native == std::endian::little, "impulse responses are stored little endian");

/// One statement for either, which in PostgreSQL is a round trip less.
constexpr const char* k_measurement_select_cir =
    "SELECT 0 AS moved, dt_ps, first_path_idx, preamble_count, re_im FROM cir WHERE range_id = ?1 UNION ALL "
    "SELECT 1, 0, NULL, NULL, digest FROM cir_moved WHERE range_id = ?1";

/// Of the DW1000, and of nearly every impulse response: kept as 0, which takes no byte. With its eight a
/// response of 1 016 samples is four bytes too long for two of them to share a page, and twice as large.
const double k_usual_dt_ps = Cir{}.dt_ps;
constexpr double k_usual = 0;

std::int64_t seq_or_none(const std::optional<std::uint64_t>& seq) {
  return seq ? static_cast<std::int64_t>(*seq) : -1;
}

std::optional<double> truth_distance_m(const Range& row) {
  return row.truth ? row.truth->distance_m : std::nullopt;
}
std::optional<bool> truth_los(const Range& row) { return row.truth ? row.truth->los : std::nullopt; }

bool same_cir(const std::optional<Cir>& a, const std::optional<Cir>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->re_im == b->re_im && a->dt_ps == b->dt_ps && a->first_path_idx == b->first_path_idx &&
         a->preamble_count == b->preamble_count;
}

bool same_upper_triangle(const std::optional<Eigen::Matrix3d>& a, const std::optional<Eigen::Matrix3d>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  for (int row = 0; row < 3; ++row) {
    for (int column = row; column < 3; ++column) {
      if ((*a)(row, column) != (*b)(row, column)) return false;
    }
  }
  return true;
}

bool same_rotation(const std::optional<Eigen::Quaterniond>& a, const std::optional<Eigen::Quaterniond>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->coeffs() == b->coeffs();
}

bool same_position(const Fix& a, const Fix& b) {
  if (a.frame != b.frame) return false;
  if (a.frame == TrackFrame::local) return a.local_m == b.local_m;
  return a.position.lat_deg == b.position.lat_deg && a.position.lon_deg == b.position.lon_deg &&
         a.position.height_m == b.position.height_m;
}

}  // namespace

void Table<Range>::bind(Query& query, std::int64_t mission_key, const Range& row) {
  query << mission_key << static_cast<int>(row.kind) << row.time << row.received << row.tag << row.antenna
        << row.anchor << row.seq << row.distance_m << row.rss_dbm << row.fp_dbm << row.rx_dbm << row.std_noise
        << row.heading_deg << truth_distance_m(row) << truth_los(row);
}

void Table<Range>::bind_identity(Query& query, std::int64_t mission_key, const Range& row) {
  query << mission_key << row.time << row.tag << row.anchor << row.antenna << seq_or_none(row.seq);
}

Range Table<Range>::read(Query& query) {
  Range row;
  row.kind = query.one_of(k_range_kind_words);
  row.time = query.time();
  row.received = query.maybe_time();
  row.tag = query.network_id();
  row.antenna = query.as<std::uint8_t>();
  row.anchor = query.network_id();
  row.seq = query.maybe([&] { return query.as<std::uint64_t>(); });
  row.distance_m = query.real();
  row.rss_dbm = query.maybe_real();
  row.fp_dbm = query.maybe_real();
  row.rx_dbm = query.maybe_real();
  row.std_noise = query.maybe_real();
  row.heading_deg = query.maybe_real();
  const RangeTruth truth{query.maybe_real(), query.maybe([&] { return query.integer() != 0; })};
  if (truth.distance_m || truth.los) row.truth = truth;
  return row;
}

std::string Table<Range>::refusal(const Range& row) {
  return std::isfinite(row.distance_m) ? "" : "a distance that is not a number";
}

void Table<Fix>::bind(Query& query, std::int64_t mission_key, const Fix& row) {
  query << mission_key << row.time << row.received << row.seq << static_cast<int>(row.frame);
  const bool on_globe = row.frame == TrackFrame::wgs84;
  bind_wgs84(query, on_globe ? std::optional(row.position) : std::nullopt);
  for (int axis = 0; axis < 3; ++axis) query << (on_globe ? std::nullopt : std::optional(row.local_m[axis]));
  query << static_cast<int>(row.fix);
  if (row.covariance_m2) {
    bind_covariance(query, *row.covariance_m2);
  } else {
    for (int i = 0; i < 6; ++i) query << std::nullopt;
  }
  for (int i = 0; i < 4; ++i) {
    query << (row.enu_from_body ? std::optional(row.enu_from_body->coeffs()[i]) : std::nullopt);
  }
  query << row.correction_age_s << row.satellites;
}

void Table<Fix>::bind_identity(Query& query, std::int64_t mission_key, const Fix& row) {
  query << mission_key << row.time << seq_or_none(row.seq);
}

Fix Table<Fix>::read(Query& query) {
  Fix row;
  row.time = query.time();
  row.received = query.maybe_time();
  row.seq = query.maybe([&] { return query.as<std::uint64_t>(); });
  row.frame = query.one_of(k_frame_words);
  row.position = read_wgs84(query).value_or(Wgs84{});
  for (int axis = 0; axis < 3; ++axis) row.local_m[axis] = query.maybe_real().value_or(0.0);
  row.fix = query.one_of(k_fix_words);
  if (query.null()) {
    query.skip(6);
  } else {
    row.covariance_m2 = read_covariance(query);
  }
  if (query.null()) {
    query.skip(4);
  } else {
    Eigen::Vector4d xyzw;
    for (int i = 0; i < 4; ++i) xyzw[i] = query.real();
    row.enu_from_body = Eigen::Quaterniond(xyzw);
  }
  row.correction_age_s = query.maybe_real();
  row.satellites = query.maybe([&] { return query.as<int>(); });
  return row;
}

std::string Table<Fix>::refusal(const Fix& row) {
  const bool finite = row.frame == TrackFrame::local
                          ? row.local_m.allFinite()
                          : std::isfinite(row.position.lat_deg) && std::isfinite(row.position.lon_deg) &&
                                std::isfinite(row.position.height_m);
  if (!finite) return "a position that is not a number";
  return row.covariance_m2 && !row.covariance_m2->allFinite() ? "a covariance that is not a number" : "";
}

double stored_dt_ps(const Cir& cir) { return cir.dt_ps == k_usual_dt_ps ? k_usual : cir.dt_ps; }
double dt_ps_of_stored(double stored) { return stored == k_usual ? k_usual_dt_ps : stored; }

void bind_cir(Query& query, std::int64_t range_id, const Cir& cir) {
  query << range_id << stored_dt_ps(cir) << cir.first_path_idx << cir.preamble_count
        << std::as_bytes(std::span<const std::int16_t>{cir.re_im});
}

StoredCir read_cir(Connection& connection, std::int64_t range_id) {
  Query query(connection, k_measurement_select_cir);
  query << range_id;
  if (!query.step()) return {};
  if (query.integer() == 0) return {read_cir_columns(query), std::nullopt};
  query.skip(3);
  return {std::nullopt, read_digest(query)};
}

CirDigest read_digest(Query& query) {
  const auto bytes = query.blob();
  CirDigest digest{};
  ANCHORD_CHECK(bytes.size() == digest.size(), "a digest of " << bytes.size() << " bytes");
  std::memcpy(digest.data(), bytes.data(), digest.size());
  return digest;
}

Cir read_cir_columns(Query& query) {
  Cir cir;
  cir.dt_ps = dt_ps_of_stored(query.real());
  cir.first_path_idx = query.maybe_real();
  cir.preamble_count = query.maybe_real();
  const auto bytes = query.blob();
  cir.re_im.resize(bytes.size() / sizeof(std::int16_t));
  if (!cir.re_im.empty())
    std::memcpy(cir.re_im.data(), bytes.data(), cir.re_im.size() * sizeof(std::int16_t));
  return cir;
}

bool same_content(const Range& a, const Range& b) {
  return a.kind == b.kind && a.distance_m == b.distance_m && a.rss_dbm == b.rss_dbm && a.fp_dbm == b.fp_dbm &&
         a.rx_dbm == b.rx_dbm && a.std_noise == b.std_noise && a.heading_deg == b.heading_deg &&
         truth_distance_m(a) == truth_distance_m(b) && truth_los(a) == truth_los(b) && same_cir(a.cir, b.cir);
}

bool same_content(const Fix& a, const Fix& b) {
  return same_position(a, b) && a.fix == b.fix && same_upper_triangle(a.covariance_m2, b.covariance_m2) &&
         same_rotation(a.enu_from_body, b.enu_from_body) && a.correction_age_s == b.correction_age_s &&
         a.satellites == b.satellites;
}

void bind_limits(Query& query, const MeasurementLimits& limits) {
  for (const auto* limit :
       {&limits.min_distance_m, &limits.max_distance_m, &limits.min_level_dbm, &limits.max_level_dbm})
    if (*limit) query << **limit;
}

void bind_covariance(Query& query, const Eigen::Matrix3d& m) {
  query << m(0, 0) << m(0, 1) << m(0, 2) << m(1, 1) << m(1, 2) << m(2, 2);
}

Eigen::Matrix3d read_covariance(Query& query) {
  Eigen::Matrix3d m;
  m(0, 0) = query.real();
  m(0, 1) = m(1, 0) = query.real();
  m(0, 2) = m(2, 0) = query.real();
  m(1, 1) = query.real();
  m(1, 2) = m(2, 1) = query.real();
  m(2, 2) = query.real();
  return m;
}

void bind_wgs84(Query& query, const std::optional<Wgs84>& position) {
  if (position) {
    query << position->lat_deg << position->lon_deg << position->height_m;
  } else {
    query << std::nullopt << std::nullopt << std::nullopt;
  }
}

std::optional<Wgs84> read_wgs84(Query& query) {
  if (query.null()) {
    query.skip(3);
    return std::nullopt;
  }
  const double lat_deg = query.real();
  const double lon_deg = query.real();
  return Wgs84{lat_deg, lon_deg, query.real()};
}

}  // namespace anchord::sql
