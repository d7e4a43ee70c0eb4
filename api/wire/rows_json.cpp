#include "api/wire/rows_json.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <concepts>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "api/kit/reader.hpp"
#include "api/wire/row_limits.hpp"
#include "core/base/base64.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

using namespace row_limits;

static_assert(std::endian::native == std::endian::little, "impulse responses are sent little endian");

template <std::size_t N>
std::optional<std::array<double, N>> read_array(Fields& fields, std::string_view key, const Bounds& bounds) {
  const auto numbers = fields.numbers(key, N, bounds.min, bounds.max);
  if (!numbers) return std::nullopt;
  std::array<double, N> out;
  std::ranges::copy(*numbers, out.begin());
  return out;
}
std::optional<double> read_number(Fields& fields, std::string_view key, const Bounds& bounds,
                                  bool required = false) {
  return fields.number(key, bounds.min, bounds.max, required);
}
std::optional<std::int64_t> read_whole(Fields& fields, std::string_view key, const WholeBounds& bounds,
                                       bool required = false) {
  return fields.integer(key, bounds.min, bounds.max, required);
}

void read_common(Fields& fields, const std::optional<MissionId>& given, MissionId& mission, UtcTime& time,
                 std::optional<UtcTime>& received, std::optional<std::uint64_t>& seq) {
  if (const auto t = read_whole(fields, "t_us", k_t_us, true)) time = UtcTime::from_us(*t);
  if (const auto t = read_whole(fields, "received_us", k_t_us)) received = UtcTime::from_us(*t);
  if (const auto n = read_whole(fields, "seq", k_seq)) seq = static_cast<std::uint64_t>(*n);
  if (fields.has("mission")) {
    if (const auto text = fields.text("mission", k_uuid_bytes, true)) {
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
      fields.error("mission", "required", "give the mission in the row or as ?mission=");
  }
}

std::optional<NetworkId> read_network_id(Fields& fields, std::string_view key) {
  const auto text = fields.text(key, k_network_id_bytes, true);
  if (!text) return std::nullopt;
  const auto id = parse_network_id(*text);
  if (id) return id.value();
  fields.error(key, "bad_id", id.error().message);
  return std::nullopt;
}

constexpr double k_no_angle_deg = 360;
constexpr const char* k_of_a_map =
    " are map or earth-centred coordinates (UTM, a national grid, ECEF): convert them to longitude and "
    "latitude, "
    "POST /api/v1/transform with \"from\": \"crs\"";

bool beyond(const Json* value, double most) {
  return value != nullptr && value->is_number() && std::abs(value->get<double>()) > most;
}

/// Numbers of a map stand where others are expected; reported with what to do, and not read.
bool of_a_map(Fields& fields) {
  bool found = false;
  for (const char* key : {"lon", "lat"}) {
    if (!beyond(fields.child(key), k_no_angle_deg)) continue;
    fields.error(key, "out_of_range", std::string("must be degrees; numbers this large") + k_of_a_map);
    found = true;
  }
  const Json* local_m = fields.child("local_m");
  if (local_m == nullptr || !local_m->is_array()) return found;
  const bool far = std::ranges::any_of(*local_m, [](const Json& x) { return beyond(&x, k_local_m.max); });
  if (far)
    fields.error(
        "local_m", "out_of_range",
        std::string("must be within 100 km of the origin of the frame; numbers this large") + k_of_a_map);
  return found || far;
}

void read_position(Fields& fields, Fix& fix) {
  const bool local = fields.has("local_m");
  if (of_a_map(fields)) {
    fields.child("h_m");
    return;
  }
  const auto local_m = read_array<3>(fields, "local_m", k_local_m);
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
  const auto lon = read_number(fields, "lon", k_lon_deg, true);
  const auto lat = read_number(fields, "lat", k_lat_deg, true);
  const auto height = read_number(fields, "h_m", k_height_m, true);
  if (lon && lat && null_island(*lon, *lat)) {
    fields.error("lat", "null_island",
                 "longitude and latitude are both 0: a receiver sends this when it has no fix");
  }
  if (lon && lat && height) fix.position = {*lat, *lon, *height};
}

void read_uncertainty(Fields& fields, Fix& fix) {
  const auto sigma = read_array<3>(fields, "sigma_m", k_sigma_m);
  const auto cov = read_array<6>(fields, "cov_enu_m2", k_covariance_m2);
  if (cov) {
    fix.covariance_m2 = covariance_of(*cov);
    if (!fix.covariance_m2)
      fields.error("cov_enu_m2", "not_positive",
                   "is not a positive definite matrix [ee, en, eu, nn, nu, uu]");
  } else if (sigma) {
    fix.covariance_m2 = covariance_of_sigmas(*sigma);
  }
}

void read_attitude(Fields& fields, Fix& fix) {
  const auto q = read_array<4>(fields, "q", k_quaternion);
  const auto heading = read_number(fields, "heading_deg", k_heading_deg);
  if (q) {
    fix.enu_from_body = rotation_of(*q);
    if (!fix.enu_from_body) fields.error("q", "not_unit", "is not a unit quaternion [qx, qy, qz, qw]");
  } else if (heading) {
    fix.enu_from_body = rotation_of_heading(*heading);
  }
}

/// Members of a row, in their order, into a document or straight into text: said once, for both.
class Document {
 public:
  explicit Document(Ordered& out) : out_(out) {}
  void put(const char* key, const auto& value) { out_[key] = value; }
  void object(const char* key, const auto& fill) {
    Ordered inner = Ordered::object();
    Document members(inner);
    fill(members);
    out_[key] = std::move(inner);
  }

 private:
  Ordered& out_;
};

class Text {
 public:
  explicit Text(std::string& out) : out_(out) {}
  void put(std::string_view key, const auto& value) {
    begin(key);
    write(value);
  }
  void object(std::string_view key, const auto& fill) {
    begin(key);
    Text members(out_);
    fill(members);
    members.end();
  }
  void end() { out_ += first_ ? "{}" : "}"; }

 private:
  void begin(std::string_view key) {
    out_ += std::exchange(first_, false) ? "{\"" : ",\"";
    (out_ += key) += "\":";
  }
  void write(double value) { append_number(out_, value); }
  void write(bool value) { out_ += value ? "true" : "false"; }
  template <std::integral Whole>
  void write(Whole value) {
    std::array<char, 24> text;
    out_.append(text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr);
  }
  void write(std::string_view value) { append_json_text(out_, value); }
  void write(const std::string& value) { append_json_text(out_, value); }  // would be a document as well
  template <std::size_t N>
  void write(const std::array<double, N>& values) {
    for (std::size_t i = 0; i < N; ++i) {
      out_ += i == 0 ? '[' : ',';
      write(values[i]);
    }
    out_ += ']';
  }
  void write(const Ordered& value) { out_ += to_wire(value); }

  std::string& out_;
  bool first_{true};
};

void put_if(auto& out, const char* key, const auto& value) {
  if (value) out.put(key, *value);
}

void put_range(auto& out, const Range& range, const std::optional<std::int64_t>& id, bool with_cir) {
  put_if(out, "id", id);
  out.put("t_us", range.time.us());
  if (range.received) out.put("received_us", range.received->us());
  out.put("mission", to_string(range.mission));
  out.put("kind", k_range_kind_words.word(range.kind));
  out.put("tag", to_string(range.tag));
  out.put("antenna", range.antenna);
  out.put("anchor", to_string(range.anchor));
  put_if(out, "seq", range.seq);
  out.put("distance_m", range.distance_m);
  put_if(out, "rss_dbm", range.rss_dbm);
  put_if(out, "fp_dbm", range.fp_dbm);
  put_if(out, "rx_dbm", range.rx_dbm);
  put_if(out, "std_noise", range.std_noise);
  put_if(out, "heading_deg", range.heading_deg);
  if (range.truth) {
    out.object("truth", [&](auto& truth) {
      put_if(truth, "distance_m", range.truth->distance_m);
      put_if(truth, "los", range.truth->los);
    });
  }
  if (range.cir && with_cir) out.put("cir", cir_json(*range.cir));
}

void put_fix(auto& out, const Fix& fix, const std::optional<std::int64_t>& id) {
  put_if(out, "id", id);
  out.put("t_us", fix.time.us());
  if (fix.received) out.put("received_us", fix.received->us());
  out.put("mission", to_string(fix.mission));
  put_if(out, "seq", fix.seq);
  if (fix.frame == TrackFrame::wgs84) {
    out.put("lon", fix.position.lon_deg);
    out.put("lat", fix.position.lat_deg);
    out.put("h_m", fix.position.height_m);
  } else {
    out.put("local_m", std::array{fix.local_m.x(), fix.local_m.y(), fix.local_m.z()});
  }
  out.put("fix", k_fix_words.word(fix.fix));
  if (fix.covariance_m2) {
    const auto& c = *fix.covariance_m2;
    out.put("cov_enu_m2", std::array{c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)});
  }
  if (fix.enu_from_body) {
    const auto& q = *fix.enu_from_body;
    out.put("q", std::array{q.x(), q.y(), q.z(), q.w()});
  }
  put_if(out, "correction_age_s", fix.correction_age_s);
  put_if(out, "satellites", fix.satellites);
}

}  // namespace

std::optional<Cir> read_cir(const Json& value, const std::string& at, std::vector<FieldError>& errors) {
  const std::size_t before = errors.size();
  Fields fields(value, at, errors);
  Cir cir;
  const auto n = read_whole(fields, "n", k_cir_taps, true);
  if (const auto dt = read_number(fields, "dt_ps", k_cir_dt_ps)) cir.dt_ps = *dt;
  cir.first_path_idx = read_number(fields, "first_path_idx", k_cir_first_path);
  cir.preamble_count = read_number(fields, "rxpacc", k_cir_preamble);
  if (const auto text = fields.text("b64", k_cir_base64_bytes, true)) {
    const auto bytes = from_base64(*text);
    if (!bytes) {
      fields.error("b64", "bad_base64", "is not base64");
    } else if (n && bytes->size() != static_cast<std::size_t>(*n) * 4) {
      fields.error(
          "b64", "wrong_length",
          "holds " + std::to_string(bytes->size()) + " bytes, but n needs " + std::to_string(*n * 4));
    } else {
      cir.re_im.resize(bytes->size() / 2);
      std::memcpy(cir.re_im.data(), bytes->data(), cir.re_im.size() * 2);
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
  if (const auto n = read_whole(fields, "antenna", k_antenna)) range.antenna = static_cast<std::uint8_t>(*n);
  const Json* distance = fields.child("distance_m");
  if (distance != nullptr && distance->is_number() && distance->get<double>() == 0) {
    fields.error("distance_m", "zero_distance", "0 mm is what a Pozyx tag reports for a failed range");
  } else if (const auto d = read_number(fields, "distance_m", k_distance_m, true)) {
    range.distance_m = *d;
  }
  range.rss_dbm = read_number(fields, "rss_dbm", k_dbm);
  range.fp_dbm = read_number(fields, "fp_dbm", k_dbm);
  range.rx_dbm = read_number(fields, "rx_dbm", k_dbm);
  range.std_noise = read_number(fields, "std_noise", k_std_noise);
  range.heading_deg = read_number(fields, "heading_deg", k_heading_deg);
  if (const Json* truth = fields.child("truth")) {
    Fields inner(*truth, "/truth", errors);
    range.truth = RangeTruth{read_number(inner, "distance_m", k_truth_distance_m), inner.boolean("los")};
    inner.text("campaign", k_campaign_bytes);
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
  fix.correction_age_s = read_number(fields, "correction_age_s", k_correction_age_s);
  if (const auto n = read_whole(fields, "satellites", k_satellites)) fix.satellites = static_cast<int>(*n);
  fields.finish();
  return fix;
}

void append_number(std::string& out, double value) {
  if (!std::isfinite(value)) {
    out += "null";
    return;
  }
  // What dump() calls: std::to_chars writes 7 for 7.0, by which readers tell one kind of number from another.
  std::array<char, 64> text;
  out.append(text.data(), nlohmann::detail::to_chars(text.data(), text.data() + text.size(), value));
}

Ordered range_json(const Range& range, std::optional<std::int64_t> id) {
  Ordered out;
  Document members(out);
  put_range(members, range, id, true);
  return out;
}

Ordered fix_json(const Fix& fix, std::optional<std::int64_t> id) {
  Ordered out;
  Document members(out);
  put_fix(members, fix, id);
  return out;
}

void append_range(std::string& out, const Range& range, std::optional<std::int64_t> id, bool with_cir,
                  const Ordered& rest) {
  Text members(out);
  put_range(members, range, id, with_cir);
  for (const auto& [key, value] : rest.items()) members.put(key, value);
  members.end();
}

void append_fix(std::string& out, const Fix& fix, std::optional<std::int64_t> id) {
  Text members(out);
  put_fix(members, fix, id);
  members.end();
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
  Document members(out);
  put_if(members, "first_path_idx", cir.first_path_idx);
  put_if(members, "rxpacc", cir.preamble_count);
  out["b64"] = base64(cir_bytes(cir));
  return out;
}

}  // namespace anchord::api
