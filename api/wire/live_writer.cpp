#include "api/wire/live_writer.hpp"

#include <charconv>
#include <cmath>

#include "api/kit/reader.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/text.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/localize/error_ellipse.hpp"

namespace anchord::api {
namespace {

/// Appends members to one object. Numbers that are not finite become null: NaN must never reach a wire.
class Object {
 public:
  Object() { out_.reserve(512); }
  Object& key(const char* name) {
    out_ += out_.empty() ? "{\"" : ",\"";
    out_ += name;
    out_ += "\":";
    return *this;
  }
  Object& number(double value, int decimals) {
    if (!std::isfinite(value)) return raw("null");
    char text[64];
    const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, decimals);
    std::size_t n = static_cast<std::size_t>(end.ptr - text);
    if (end.ec != std::errc{}) return raw("null");
    if (decimals > 0) {
      while (text[n - 1] == '0') --n;
      if (text[n - 1] == '.') --n;
    }
    out_.append(text, n);
    return *this;
  }
  Object& small(double value) {  // covariances span many decades
    if (!std::isfinite(value)) return raw("null");
    char text[64];
    const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::general, 5);
    out_.append(text, end.ptr);
    return *this;
  }
  Object& integer(std::int64_t value) {
    out_ += std::to_string(value);
    return *this;
  }
  Object& text(std::string_view value) {
    append_json_text(out_, value);
    return *this;
  }
  Object& raw(std::string_view json) {
    out_ += json;
    return *this;
  }
  Object& optional(const std::optional<double>& value, int decimals) {
    return value ? number(*value, decimals) : raw("null");
  }
  Object& vector(const Eigen::Vector3d& v, int decimals) {
    raw("[")
        .number(v.x(), decimals)
        .raw(",")
        .number(v.y(), decimals)
        .raw(",")
        .number(v.z(), decimals)
        .raw("]");
    return *this;
  }
  std::string take() { return std::move(out_ += '}'); }

 private:
  std::string out_;
};

/// The models that gave the range its class or bias, by task; nothing where none did.
void models(Object& out, const RangeModels& spoke) {
  std::string list;
  const auto put = [&list](const char* task, const std::optional<ModelId>& id) {
    if (id) list.append(list.empty() ? "{\"" : ",\"").append(task).append("\":\"" + to_string(*id) + "\"");
  };
  put("nlos_id", spoke.nlos_id);
  put("los_bias", spoke.los_bias);
  put("nlos_bias", spoke.nlos_bias);
  put("bias", spoke.bias);
  if (!list.empty()) out.key("models").raw(list + "}");
}

void place(Object& out, const std::optional<Wgs84>& at) {
  out.key("lon").optional(at ? std::optional(at->lon_deg) : std::nullopt, 9);
  out.key("lat").optional(at ? std::optional(at->lat_deg) : std::nullopt, 9);
  out.key("h_m").optional(at ? std::optional(at->height_m) : std::nullopt, 4);
}

std::optional<Eigen::Vector3d> sigma_m(const Fix& fix) {
  if (!fix.covariance_m2) return std::nullopt;
  return fix.covariance_m2->diagonal().cwiseMax(0.0).cwiseSqrt();
}

/// Clockwise from north; absent in a local frame without meaning of north, or without attitude.
std::optional<double> heading_deg(const Fix& fix) {
  if (!fix.enu_from_body) return std::nullopt;
  const Eigen::Vector3d forward = *fix.enu_from_body * Eigen::Vector3d::UnitX();
  double deg = std::atan2(forward.x(), forward.y()) * 180.0 / 3.14159265358979323846;
  return deg < 0 ? deg + 360 : deg;
}

void put_uncertainty(Object& out, const Estimate& estimate) {
  if (estimate.best && estimate.best->covariance_m2.allFinite()) {
    const auto& c = estimate.best->covariance_m2;
    out.key("cov_enu_m2")
        .raw("[")
        .small(c(0, 0))
        .raw(",")
        .small(c(0, 1))
        .raw(",")
        .small(c(0, 2))
        .raw(",")
        .small(c(1, 1))
        .raw(",")
        .small(c(1, 2))
        .raw(",")
        .small(c(2, 2))
        .raw("]");
    const ErrorEllipse ellipse = error_ellipse(c);
    Object inner;
    inner.key("major_m")
        .number(ellipse.major_m, 4)
        .key("minor_m")
        .number(ellipse.minor_m, 4)
        .key("azimuth_deg")
        .number(ellipse.azimuth_deg, 1);
    out.key("ellipse95").raw(inner.take());
    out.key("h95_m").number(estimate.h95_m, 4).key("v95_m").number(estimate.v95_m, 4);
  } else {
    out.key("cov_enu_m2")
        .raw("null")
        .key("ellipse95")
        .raw("null")
        .key("h95_m")
        .raw("null")
        .key("v95_m")
        .raw("null");
  }
}

void put_mirror(Object& out, const Estimate& estimate) {
  out.key("mirror");
  if (estimate.mirror) {
    Object mirror;
    mirror.key("enu_m").vector(estimate.mirror->position.m, 4);
    place(mirror, estimate.mirror->wgs84);
    mirror.key("probability").number(estimate.mirror->probability, 3);
    out.raw(mirror.take());
  } else {
    out.raw("null");
  }
}

void put_gates(Object& out, const std::vector<Gate>& all) {
  std::string gates = "[";
  for (const Gate& gate : all) {
    Object inner;
    inner.key("name").text(gate.name).key("value").optional(gate.value, 4);
    inner.key("limit").number(gate.limit, 4).key("passed").raw(gate.passed ? "true" : "false");
    inner.key("why").text(gate.why);
    gates += (gates.size() > 1 ? "," : "") + inner.take();
  }
  out.key("gates").raw(gates + "]");
}

}  // namespace

std::string live_pose_json(const MissionId& mission, TrackFrame frame, const flight::PoseMoved& pose) {
  Object out;
  out.key("mission").text(to_string(mission)).key("t_us").integer(pose.time.us());
  place(out, frame == TrackFrame::wgs84 ? std::optional(pose.fix.position) : std::nullopt);
  out.key("enu_m").vector(pose.enu_m, 4);
  out.key("heading_deg").optional(heading_deg(pose.fix), 2).key("fix").text(k_fix_words.word(pose.fix.fix));
  out.key("sigma_m");
  if (const auto sigma = sigma_m(pose.fix))
    out.vector(*sigma, 4);
  else
    out.raw("null");
  out.key("tag_enu_m");
  if (pose.tag_enu_m)
    out.vector(*pose.tag_enu_m, 4);
  else
    out.raw("null");
  out.key("speed_mps").optional(pose.speed_mps, 3);
  return out.take();
}

std::string live_rtk_json(const MissionId& mission, const Fix& fix) {
  Object out;
  out.key("mission")
      .text(to_string(mission))
      .key("t_us")
      .integer(fix.time.us())
      .key("fix")
      .text(k_fix_words.word(fix.fix));
  out.key("satellites");
  if (fix.satellites)
    out.integer(*fix.satellites);
  else
    out.raw("null");
  out.key("correction_age_s").optional(fix.correction_age_s, 2).key("sigma_m");
  if (const auto sigma = sigma_m(fix))
    out.vector(*sigma, 4);
  else
    out.raw("null");
  return out.take();
}

std::string live_range_json(const MissionId& mission, const RangeResult& result) {
  const Range& range = result.range;
  Object out;
  out.key("t_us").integer(range.time.us()).key("mission").text(to_string(mission));
  out.key("tag").text(to_string(range.tag)).key("anchor").text(to_string(range.anchor));
  out.key("distance_m").number(range.distance_m, 4);
  out.key("corrected_m").number(result.corrected_m.value_or(range.distance_m), 4);
  out.key("sigma_m")
      .optional(result.sigma_m, 4)
      .key("rss_dbm")
      .optional(range.rss_dbm, 2)
      .key("p_los")
      .optional(result.model ? result.model->p_los : std::nullopt, 3);
  out.key("tag_enu_m");
  if (result.tag_enu_m)
    out.vector(*result.tag_enu_m, 4);
  else
    out.raw("null");
  out.key("residual_m").optional(result.residual_m, 4);
  out.key("used").raw(result.used() ? "true" : "false").key("refused");
  if (result.used())
    out.raw("null");
  else
    out.text(result.refused);
  if (result.model) models(out, result.model->models);
  return out.take();
}

std::string live_fix_json(const MissionId& mission, const Fix& fix) {
  Object out;
  out.key("t_us").integer(fix.time.us()).key("mission").text(to_string(mission));
  place(out, fix.frame == TrackFrame::wgs84 ? std::optional(fix.position) : std::nullopt);
  out.key("local_m");
  if (fix.frame == TrackFrame::local)
    out.vector(fix.local_m, 4);
  else
    out.raw("null");
  out.key("fix").text(k_fix_words.word(fix.fix)).key("sigma_m");
  if (const auto sigma = sigma_m(fix))
    out.vector(*sigma, 4);
  else
    out.raw("null");
  return out.take();
}

std::string live_estimate_json(const MissionId& mission, const Estimate& estimate,
                               std::optional<double> models_moved_m) {
  Object out;
  std::size_t refused = 0;
  for (const auto& [reason, n] : estimate.refused) refused += n;
  out.key("mission")
      .text(to_string(mission))
      .key("anchor")
      .text(to_string(estimate.anchor))
      .key("t_us")
      .integer(estimate.time.us());
  out.key("status")
      .text(flight::anchor_status(estimate))
      .key("verdict")
      .text(k_verdict_words.word(estimate.verdict))
      .key("reason")
      .text(estimate.reason);
  out.key("enu_m");
  if (estimate.best)
    out.vector(estimate.best->position.m, 4);
  else
    out.raw("null");
  place(out, estimate.best ? estimate.best->wgs84 : std::nullopt);
  put_uncertainty(out, estimate);
  out.key("gdop").optional(estimate.gdop, 3).key("gdop_trace").optional(estimate.gdop_trace, 3);
  out.key("n_ranges")
      .integer(static_cast<std::int64_t>(estimate.n_used))
      .key("n_refused")
      .integer(static_cast<std::int64_t>(refused));
  out.key("rms_residual_m")
      .optional(estimate.best ? std::optional(estimate.best->rms_residual_m) : std::nullopt, 4);
  if (models_moved_m) out.key("models_moved_m").number(*models_moved_m, 4);
  out.key("probability")
      .optional(estimate.best ? std::optional(estimate.best->probability) : std::nullopt, 3);
  put_mirror(out, estimate);
  put_gates(out, estimate.gates);
  return out.take();
}

std::string mission_state_json(const Mission& mission, const flight::LiveState& state) {
  Object out;
  out.key("mission")
      .text(to_string(mission.id))
      .key("name")
      .text(mission.name)
      .key("state")
      .text(k_mission_state_words.word(mission.state));
  out.key("t_us").integer(state.time.us()).key("started_us");
  if (state.started)
    out.integer(state.started->us());
  else
    out.raw("null");
  out.key("frame").text(k_frame_words.word(mission.frame)).key("origin");
  if (state.origin) {
    Object origin;
    place(origin, state.origin);
    out.raw(origin.take());
  } else {
    out.raw("null");
  }
  out.key("n_ranges")
      .integer(static_cast<std::int64_t>(state.n_ranges))
      .key("n_fixes")
      .integer(static_cast<std::int64_t>(state.n_fixes));
  out.key("anchors_found")
      .integer(static_cast<std::int64_t>(state.anchors_found))
      .key("anchors_converged")
      .integer(static_cast<std::int64_t>(state.anchors_converged));
  out.key("range_rate_hz").number(state.range_rate_hz, 1);
  std::string refused;
  for (const auto& [reason, n] : state.fixes_refused)
    refused += (refused.empty() ? "" : ",") + json_text(reason) + ':' + std::to_string(n);
  out.key("fixes_refused").raw('{' + refused + '}');
  return out.take();
}

}  // namespace anchord::api
