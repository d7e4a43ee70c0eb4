#include "server/storage/calibration_rows.hpp"
#include "server/storage/measurement_rows.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_estimate_insert =
    "INSERT INTO estimate (calibration_key, network_id, ordinal, t_ns, verdict, reason, h95_m, v95_m, gdop, "
    "gdop_trace, "
    "n_used, bias_m, bias_sigma_m, lag_s, lag_sigma_s) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15)";
constexpr const char* k_insert_hypothesis =
    "INSERT INTO hypothesis (calibration_key, network_id, is_mirror, e_m, n_m, u_m, lat_deg, lon_deg, "
    "height_m, "
    "cov_ee_m2, cov_en_m2, cov_eu_m2, cov_nn_m2, cov_nu_m2, cov_uu_m2, rms_residual_m, probability) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17)";
constexpr const char* k_insert_refused =
    "INSERT INTO estimate_refused (calibration_key, network_id, reason, n_ranges) VALUES (?1, ?2, ?3, ?4)";
constexpr const char* k_estimate_columns =
    "SELECT network_id, t_ns, verdict, reason, h95_m, v95_m, gdop, gdop_trace, n_used, bias_m, bias_sigma_m, "
    "lag_s, "
    "lag_sigma_s FROM estimate WHERE calibration_key = ?1 ";
constexpr const char* k_hypotheses =
    "SELECT is_mirror, e_m, n_m, u_m, lat_deg, lon_deg, height_m, cov_ee_m2, cov_en_m2, cov_eu_m2, "
    "cov_nn_m2, "
    "cov_nu_m2, cov_uu_m2, rms_residual_m, probability FROM hypothesis WHERE calibration_key = ?1 AND "
    "network_id = ?2";
constexpr const char* k_refused =
    "SELECT reason, n_ranges FROM estimate_refused WHERE calibration_key = ?1 AND network_id = ?2";

constexpr const char* k_insert_gate =
    "INSERT INTO estimate_gate (calibration_key, network_id, ordinal, name, value, limit_value, passed, why) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)";
constexpr const char* k_gates =
    "SELECT name, value, limit_value, passed, why FROM estimate_gate WHERE calibration_key = ?1 AND "
    "network_id = ?2 ORDER BY ordinal";

void store_hypothesis(Connection& c, std::int64_t key, NetworkId anchor, bool is_mirror,
                      const Hypothesis& h) {
  Query query(c, k_insert_hypothesis);
  query << key << anchor << is_mirror << h.position.m.x() << h.position.m.y() << h.position.m.z();
  bind_wgs84(query, h.wgs84);
  bind_covariance(query, h.covariance_m2);
  query << h.rms_residual_m << h.probability;
  query.run();
}

void read_parts(Connection& c, std::int64_t key, Estimate& e) {
  Query query(c, k_hypotheses);
  query << key << e.anchor;
  while (query.step()) {
    const bool is_mirror = query.integer() != 0;
    Hypothesis h;
    for (int axis = 0; axis < 3; ++axis) h.position.m[axis] = query.real();
    h.wgs84 = read_wgs84(query);
    h.covariance_m2 = read_covariance(query);
    h.rms_residual_m = query.real();
    h.probability = query.real();
    (is_mirror ? e.mirror : e.best) = h;
  }
  Query refused(c, k_refused);
  refused << key << e.anchor;
  while (refused.step()) {
    std::string reason = refused.text();
    e.refused[std::move(reason)] = refused.as<std::size_t>();
  }
  Query gates(c, k_gates);
  gates << key << e.anchor;
  while (gates.step()) {
    anchord::Gate gate;
    gate.name = gates.text();
    gate.value = gates.maybe_real();
    gate.limit = gates.real();
    gate.passed = gates.integer() != 0;
    gate.why = gates.text();
    e.gates.push_back(std::move(gate));
  }
}

Estimate read_estimate(Connection& c, std::int64_t key, Query& query) {
  Estimate e;
  e.anchor = query.network_id();
  e.time = query.time();
  e.verdict = query.one_of(k_verdict_words);
  e.reason = query.text();
  e.h95_m = query.real();
  e.v95_m = query.real();
  e.gdop = query.maybe_real();
  e.gdop_trace = query.maybe_real();
  e.n_used = query.as<std::size_t>();
  e.bias_m = query.maybe_real();
  e.bias_sigma_m = query.maybe_real();
  e.lag_s = query.maybe_real();
  e.lag_sigma_s = query.maybe_real();
  read_parts(c, key, e);
  return e;
}

}  // namespace

void store_estimates(Connection& connection, std::int64_t calibration_key,
                     const std::vector<Estimate>& estimates) {
  std::int64_t ordinal = 0;
  for (const Estimate& e : estimates) {
    Query query(connection, k_estimate_insert);
    query << calibration_key << e.anchor << ordinal++ << e.time << static_cast<int>(e.verdict) << e.reason
          << e.h95_m << e.v95_m << e.gdop << e.gdop_trace << std::uint64_t{e.n_used} << e.bias_m
          << e.bias_sigma_m << e.lag_s << e.lag_sigma_s;
    query.run();
    if (e.best) store_hypothesis(connection, calibration_key, e.anchor, false, *e.best);
    if (e.mirror) store_hypothesis(connection, calibration_key, e.anchor, true, *e.mirror);
    for (const auto& [reason, n] : e.refused) {
      Query refused(connection, k_insert_refused);
      refused << calibration_key << e.anchor << reason << std::uint64_t{n};
      refused.run();
    }
    std::int64_t place = 0;
    for (const anchord::Gate& gate : e.gates) {
      Query insert(connection, k_insert_gate);
      insert << calibration_key << e.anchor << place++ << gate.name << gate.value << gate.limit << gate.passed
             << gate.why;
      insert.run();
    }
  }
}

std::vector<Estimate> read_estimates(Connection& connection, std::int64_t calibration_key) {
  Query query(connection, std::string(k_estimate_columns) + "ORDER BY ordinal");
  query << calibration_key;
  std::vector<Estimate> found;
  while (query.step()) found.push_back(read_estimate(connection, calibration_key, query));
  return found;
}

std::optional<Estimate> read_estimate(Connection& connection, std::int64_t calibration_key,
                                      NetworkId anchor) {
  Query query(connection, std::string(k_estimate_columns) + "AND network_id = ?2");
  query << calibration_key << anchor;
  if (!query.step()) return std::nullopt;
  return read_estimate(connection, calibration_key, query);
}

}  // namespace anchord::sql
