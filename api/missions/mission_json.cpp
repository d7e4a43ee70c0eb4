#include "api/missions/mission_json.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/wire/live_writer.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

Ordered mission_json(const Mission& mission, std::optional<std::uint64_t> n_ranges,
                     std::optional<std::uint64_t> n_fixes) {
  Ordered tags = Ordered::array();
  for (const auto& tag : mission.tags) {
    const auto& arm = tag.lever_arm_body_m;
    tags.push_back({{"tag", to_string(tag.tag)},
                    {"antenna", tag.antenna},
                    {"lever_arm_body_m", {arm.x(), arm.y(), arm.z()}}});
  }
  Ordered out{{"id", to_string(mission.id)}, {"name", mission.name}};
  out["site"] = mission.site ? Ordered(to_string(*mission.site)) : Ordered(nullptr);
  out["kit"] = mission.kit;
  out["radio"] = mission.radio;
  out["frame"] = k_frame_words.word(mission.frame);
  out["track_point"] = k_point_words.word(mission.point);
  out["tags"] = std::move(tags);
  out["lever_arm_sigma_m"] = or_null(mission.lever_arm_sigma_m);
  out["state"] = k_mission_state_words.word(mission.state);
  out["created_at"] = to_rfc3339(mission.created);
  out["finished_at"] = mission.finished ? Ordered(to_rfc3339(*mission.finished)) : Ordered(nullptr);
  out["n_ranges"] = or_null(n_ranges);
  out["n_fixes"] = or_null(n_fixes);
  return out;
}

Mission read_mission(const Json& body, std::vector<FieldError>& errors) {
  Mission mission;
  Fields fields(body, "", errors);
  if (const auto text = fields.text("name", record_limits::k_name, true)) mission.name = *text;
  if (const auto text = fields.text("kit", record_limits::k_name)) mission.kit = *text;
  if (const auto text = fields.text("radio", record_limits::k_name)) mission.radio = *text;
  if (const auto text = fields.text("site", 36)) {
    const auto id = parse_uuid(*text);
    if (id)
      mission.site = SiteId{id.value()};
    else
      fields.error("site", "bad_id", id.error().message);
  }
  if (const auto frame = fields.word("frame", k_frame_words, true)) mission.frame = *frame;
  // Required: an arm applied to the wrong point is a silent error of decimetres.
  if (const auto point = fields.word("track_point", k_point_words, true)) mission.point = *point;
  if (const Json* tags = fields.child("tags")) {
    if (!tags->is_array() || tags->size() > record_limits::k_most_tags) {
      fields.error("tags", "wrong_type", "must be an array of at most 64 tag antennas");
    } else {
      for (std::size_t i = 0; i < tags->size(); ++i) {
        Fields inner((*tags)[i], "/tags/" + std::to_string(i), errors);
        TagAntenna tag;
        if (const auto text = inner.text("tag", 20, true)) {
          const auto id = parse_network_id(*text);
          if (id)
            tag.tag = id.value();
          else
            inner.error("tag", "bad_id", id.error().message);
        }
        if (const auto n = inner.integer("antenna", 0, 255)) tag.antenna = static_cast<std::uint8_t>(*n);
        if (const auto arm = inner.numbers("lever_arm_body_m", 3, record_limits::k_lever_arm_m.min,
                                           record_limits::k_lever_arm_m.max, true))
          tag.lever_arm_body_m = {(*arm)[0], (*arm)[1], (*arm)[2]};
        inner.finish();
        for (const auto& other : mission.tags) {
          if (other.tag == tag.tag && other.antenna == tag.antenna)
            inner.error("tag", "duplicate", "this antenna of the tag occurs twice");
        }
        mission.tags.push_back(tag);
      }
    }
  }
  mission.lever_arm_sigma_m =
      fields.number("lever_arm_sigma_m", k_least_lever_arm_sigma_m, k_most_lever_arm_sigma_m);
  fields.finish();
  return mission;
}

}  // namespace anchord::api
