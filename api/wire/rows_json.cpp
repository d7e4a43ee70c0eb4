#include "api/wire/rows_json.hpp"

#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "core/base/base64.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::int64_t k_year_2100_us = 4'102'444'800'000'000;
constexpr double k_min_distance_m = 0.05, k_max_distance_m = 150.0;  // reliability.md section 4
constexpr double k_pi = 3.14159265358979323846;

void read_common(Fields& fields, const std::optional<MissionId>& given, MissionId& mission, UtcTime& time,
                 std::optional<UtcTime>& received, std::optional<std::uint64_t>& seq) {
  if (const auto t = fields.integer("t_us", 0, k_year_2100_us, true)) time = UtcTime::from_us(*t);
  if (const auto t = fields.integer("received_us", 0, k_year_2100_us)) received = UtcTime::from_us(*t);
  if (const auto n = fields.integer("seq", 0, INT64_MAX)) seq = static_cast<std::uint64_t>(*n);
  if (fields.has("mission")) {
    if (const auto text = fields.text("mission", 36, true)) {
      const auto id = parse_uuid(*text);
      if (id)
        mission.uuid = id.value();
      else
        fields.error("mission", "unknown_mission", "'" + *text + "' is not the id of a mission");
    }
  } else {
    fields.child("mission");
    if (given)
      mission = *given;
    else
      fields.error("mission", "required", "name the mission in the row or as ?mission=");
  }
}

std::optional<NetworkId> read_network_id(Fields& fields, std::string_view key) {
  const auto text = fields.text(key, 20, true);
  if (!text) return std::nullopt;
  const auto id = parse_network_id(*text);
  if (id) return id.value();
  fields.error(key, "bad_id", id.error().message);
  return std::nullopt;
}

void read_position(Fields& fields, Fix& fix) {
  const bool local = fields.has("local_m");
  const auto local_m = fields.numbers("local_m", 3, -1e5, 1e5);
  if (local) {
    fix.frame = TrackFrame::local;
    if (local_m) fix.local_m = {(*local_m)[0], (*local_m)[1], (*local_m)[2]};
    for (const auto* key : {"lon", "lat", "h_m"}) {
      if (fields.has(key)) fields.error(key, "conflict", "give lon, lat, h_m or local_m, not both");
      fields.child(key);
    }
    return;
  }
  fix.frame = TrackFrame::wgs84;
  const auto lon = fields.number("lon", -180, 180, true);
  const auto lat = fields.number("lat", -90, 90, true);
  const auto height = fields.number("h_m", -500, 9000, true);
  if (lon && lat && *lon == 0 && *lat == 0) {
    fields.error("lat", "null_island",
                 "longitude and latitude are both 0: what a receiver without a fix sends");
  }
  if (lon && lat && height) fix.position = {*lat, *lon, *height};
}

void read_uncertainty(Fields& fields, Fix& fix) {
  const auto sigma = fields.numbers("sigma_m", 3, 1e-5, 1000);
  const auto cov = fields.numbers("cov_enu_m2", 6, -1e6, 1e6);
  if (cov) {
    Eigen::Matrix3d c;
    const auto& v = *cov;
    c << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
    // Sylvester: all leading minors positive.
    if (c(0, 0) > 0 && c(0, 0) * c(1, 1) - c(0, 1) * c(0, 1) > 0 && c.determinant() > 0)
      fix.covariance_m2 = c;
    else
      fields.error("cov_enu_m2", "not_positive",
                   "is not a positive definite matrix [ee, en, eu, nn, nu, uu]");
  } else if (sigma) {
    fix.covariance_m2 =
        Eigen::Vector3d((*sigma)[0] * (*sigma)[0], (*sigma)[1] * (*sigma)[1], (*sigma)[2] * (*sigma)[2])
            .asDiagonal();
  }
}

void read_attitude(Fields& fields, Fix& fix) {
  const auto q = fields.numbers("q", 4, -1.01, 1.01);
  const auto heading = fields.number("heading_deg", -360, 360);
  if (q) {
    const Eigen::Quaterniond rotation((*q)[3], (*q)[0], (*q)[1], (*q)[2]);
    if (std::abs(rotation.norm() - 1) > 0.01)
      fields.error("q", "not_unit", "is not a unit quaternion [qx, qy, qz, qw]");
    else
      fix.enu_from_body = rotation.normalized();
  } else if (heading) {
    // Clockwise from north; the body's x axis points forward, ENU angles count counter-clockwise from east.
    const double yaw_rad = (90.0 - *heading) * k_pi / 180.0;
    fix.enu_from_body = Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
  }
}

void put_if(Ordered& out, const char* key, const auto& value) {
  if (value) out[key] = *value;
}

}  // namespace

std::optional<Cir> read_cir(const Json& value, const std::string& at, std::vector<FieldError>& errors) {
  const std::size_t before = errors.size();
  Fields fields(value, at, errors);
  Cir cir;
  const auto n = fields.integer("n", 1, 4096, true);
  if (const auto dt = fields.number("dt_ps", 1, 1e6)) cir.dt_ps = *dt;
  cir.first_path_idx = fields.number("first_path_idx", 0, 4096);
  cir.preamble_count = fields.number("rxpacc", 0, 1e6);
  if (const auto text = fields.text("b64", 32768, true)) {
    const auto bytes = from_base64(*text);
    if (!bytes) {
      fields.error("b64", "bad_base64", "is not base64");
    } else if (n && bytes->size() != static_cast<std::size_t>(*n) * 4) {
      fields.error("b64", "wrong_length",
                   "holds " + std::to_string(bytes->size()) + " bytes, n says " + std::to_string(*n * 4));
    } else {
      cir.re_im.resize(bytes->size() / 2);
      for (std::size_t i = 0; i < cir.re_im.size(); ++i) {
        const auto low = static_cast<unsigned char>((*bytes)[2 * i]);
        const auto high = static_cast<unsigned char>((*bytes)[2 * i + 1]);
        cir.re_im[i] = static_cast<std::int16_t>(static_cast<std::uint16_t>(low | (high << 8)));
      }
    }
  }
  fields.finish();
  if (errors.size() != before) return std::nullopt;
  return cir;
}

RangeRow read_range(const Json& row, const std::optional<MissionId>& mission,
                    std::vector<FieldError>& errors) {
  RangeRow out;
  Range& range = out.range;
  Fields fields(row, "", errors);
  if (!fields.is_object()) return out;
  read_common(fields, mission, range.mission, range.time, range.received, range.seq);
  if (const auto kind = fields.word("kind", k_range_kind_words)) range.kind = *kind;
  if (const auto id = read_network_id(fields, "tag")) range.tag = *id;
  if (const auto id = read_network_id(fields, "anchor")) range.anchor = *id;
  if (range.anchor == range.tag && range.anchor.value != 0)
    fields.error("anchor", "same_device", "a radio cannot measure the distance to itself");
  if (const auto n = fields.integer("antenna", 0, 255)) range.antenna = static_cast<std::uint8_t>(*n);
  const Json* distance = fields.child("distance_m");
  if (distance != nullptr && distance->is_number() && distance->get<double>() == 0) {
    fields.error("distance_m", "zero_distance", "0 mm is the Pozyx failure value");
  } else if (const auto d = fields.number("distance_m", k_min_distance_m, k_max_distance_m, true)) {
    range.distance_m = *d;
  }
  range.rss_dbm = fields.number("rss_dbm", -200, 50);
  range.fp_dbm = fields.number("fp_dbm", -200, 50);
  range.rx_dbm = fields.number("rx_dbm", -200, 50);
  range.std_noise = fields.number("std_noise", 0, 65535);
  range.heading_deg = fields.number("heading_deg", -360, 360);
  if (const Json* truth = fields.child("truth")) {
    Fields inner(*truth, "/truth", errors);
    range.truth = RangeTruth{inner.number("distance_m", 0, 1000), inner.boolean("los")};
    inner.text("campaign", 200);
    inner.finish();
  }
  if (const Json* cir = fields.child("cir")) range.cir = read_cir(*cir, "/cir", errors);
  if (const Json* pose = fields.child("pose")) {
    Fix fix;
    fix.mission = range.mission;
    fix.time = range.time;
    Fields inner(*pose, "/pose", errors);
    read_position(inner, fix);
    if (const auto word = inner.word("fix", k_fix_words, true)) fix.fix = *word;
    read_uncertainty(inner, fix);
    read_attitude(inner, fix);
    inner.finish();
    out.pose = fix;
  }
  fields.finish();
  return out;
}

Fix read_fix(const Json& row, const std::optional<MissionId>& mission, std::vector<FieldError>& errors) {
  Fix fix;
  Fields fields(row, "", errors);
  if (!fields.is_object()) return fix;
  read_common(fields, mission, fix.mission, fix.time, fix.received, fix.seq);
  read_position(fields, fix);
  if (const auto word = fields.word("fix", k_fix_words, true)) fix.fix = *word;
  read_uncertainty(fields, fix);
  read_attitude(fields, fix);
  fix.correction_age_s = fields.number("correction_age_s", 0, 1e6);
  if (const auto n = fields.integer("satellites", 0, 255)) fix.satellites = static_cast<int>(*n);
  fields.finish();
  return fix;
}

Ordered range_json(const Range& range, std::optional<std::int64_t> id) {
  Ordered out;
  put_if(out, "id", id);
  out["t_us"] = range.time.us();
  if (range.received) out["received_us"] = range.received->us();
  out["mission"] = to_string(range.mission);
  out["kind"] = k_range_kind_words.word(range.kind);
  out["tag"] = to_string(range.tag);
  out["antenna"] = range.antenna;
  out["anchor"] = to_string(range.anchor);
  put_if(out, "seq", range.seq);
  out["distance_m"] = range.distance_m;
  put_if(out, "rss_dbm", range.rss_dbm);
  put_if(out, "fp_dbm", range.fp_dbm);
  put_if(out, "rx_dbm", range.rx_dbm);
  put_if(out, "std_noise", range.std_noise);
  put_if(out, "heading_deg", range.heading_deg);
  if (range.truth) {
    Ordered truth = Ordered::object();
    put_if(truth, "distance_m", range.truth->distance_m);
    put_if(truth, "los", range.truth->los);
    out["truth"] = std::move(truth);
  }
  if (range.cir) out["cir"] = cir_json(*range.cir);
  return out;
}

Ordered fix_json(const Fix& fix, std::optional<std::int64_t> id) {
  Ordered out;
  put_if(out, "id", id);
  out["t_us"] = fix.time.us();
  if (fix.received) out["received_us"] = fix.received->us();
  out["mission"] = to_string(fix.mission);
  put_if(out, "seq", fix.seq);
  if (fix.frame == TrackFrame::wgs84) {
    out["lon"] = fix.position.lon_deg;
    out["lat"] = fix.position.lat_deg;
    out["h_m"] = fix.position.height_m;
  } else {
    out["local_m"] = {fix.local_m.x(), fix.local_m.y(), fix.local_m.z()};
  }
  out["fix"] = k_fix_words.word(fix.fix);
  if (fix.covariance_m2) {
    const auto& c = *fix.covariance_m2;
    out["cov_enu_m2"] = {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)};
  }
  if (fix.enu_from_body) {
    const auto& q = *fix.enu_from_body;
    out["q"] = {q.x(), q.y(), q.z(), q.w()};
  }
  put_if(out, "correction_age_s", fix.correction_age_s);
  put_if(out, "satellites", fix.satellites);
  return out;
}

std::string cir_bytes(const Cir& cir) {
  std::string bytes;
  bytes.reserve(cir.re_im.size() * 2);
  for (const std::int16_t sample : cir.re_im) {
    const auto u = static_cast<std::uint16_t>(sample);
    bytes += static_cast<char>(u & 0xff);
    bytes += static_cast<char>(u >> 8);
  }
  return bytes;
}

Ordered cir_json(const Cir& cir) {
  Ordered out{{"n", cir.re_im.size() / 2}, {"dt_ps", cir.dt_ps}};
  put_if(out, "first_path_idx", cir.first_path_idx);
  put_if(out, "rxpacc", cir.preamble_count);
  out["b64"] = base64(cir_bytes(cir));
  return out;
}

}  // namespace anchord::api
