#include "api/measurements/flight_requests.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/wire/rows_json.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

Json parsed(std::string_view body) { return Json::parse(body, nullptr, false); }

std::string text_of(const Json& object, const char* key) {
  if (!object.is_object()) return {};
  const auto it = object.find(key);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string{};
}

// Nothing of a recording is thrown away for bytes that are not UTF-8.
std::string dumped(const Ordered& json) { return to_wire(json); }

template <class Row, class Read>
Result<std::vector<Row>> parse_rows(std::string_view ndjson, Read read) {
  std::vector<Row> rows;
  while (!ndjson.empty()) {
    const std::size_t end = std::min(ndjson.find('\n'), ndjson.size());
    Json row = parsed(ndjson.substr(0, end));
    ndjson.remove_prefix(std::min(end + 1, ndjson.size()));
    std::vector<FieldError> errors;
    if (row.is_object()) row.erase("id");
    rows.push_back(read(row, errors));
    if (!errors.empty()) {
      return make_error(Errc::bad_frame,
                        "stored row " + std::to_string(rows.size()) + ": " + errors.front().detail);
    }
  }
  return rows;
}

TagAntenna parse_tag(const Json& json) {
  TagAntenna tag;
  tag.tag = parse_network_id(json.at("tag").get<std::string>()).value();
  tag.antenna = json.value("antenna", std::uint8_t{0});
  const auto arm = json.at("lever_arm_body_m").get<std::vector<double>>();
  tag.lever_arm_body_m = {arm.at(0), arm.at(1), arm.at(2)};
  return tag;
}

}  // namespace

Result<Mission> parse_mission(std::string_view body) {
  const Json json = parsed(body);
  Mission mission;
  try {
    mission.name = json.at("name").get<std::string>();
    mission.kit = text_of(json, "kit");
    mission.radio = text_of(json, "radio");
    BOOST_OUTCOME_TRY(mission.frame, k_frame_words.parse("frame", json.at("frame").get<std::string>()));
    BOOST_OUTCOME_TRY(mission.point,
                      k_point_words.parse("track_point", json.at("track_point").get<std::string>()));
    for (const Json& tag : json.at("tags")) mission.tags.push_back(parse_tag(tag));
    // Absent from servers of before 0.2.
    if (const auto sigma = json.find("lever_arm_sigma_m"); sigma != json.end() && !sigma->is_null()) {
      mission.lever_arm_sigma_m = sigma->get<double>();
      if (!is_lever_arm_sigma(*mission.lever_arm_sigma_m))
        return make_error(Errc::bad_frame,
                          std::string("not a mission: lever_arm_sigma_m ") + k_lever_arm_sigma_rule);
    }
  } catch (const std::exception& error) {
    return make_error(Errc::bad_frame, std::string("not a mission: ") + error.what());
  }
  return mission;
}

Result<std::vector<Fix>> parse_fixes(std::string_view ndjson) {
  return parse_rows<Fix>(ndjson,
                         [](const Json& row, auto& errors) { return read_fix(row, std::nullopt, errors); });
}

Result<RangePage> parse_range_page(std::string_view body) {
  Json json = parsed(body);
  const auto items = json.is_object() ? json.find("items") : json.end();
  if (items == json.end() || !items->is_array())
    return make_error(Errc::bad_frame, "not a page of ranges: " + to_utf8(body, 200));
  RangePage page;
  for (Json& row : *items) {
    std::vector<FieldError> errors;
    if (row.is_object()) row.erase("id");
    page.rows.push_back(read_range(row, std::nullopt, errors).range);
    if (!errors.empty()) return make_error(Errc::bad_frame, "a stored range: " + errors.front().detail);
  }
  page.next_cursor = text_of(json, "next_cursor");
  return page;
}

std::string mission_request_json(const Mission& mission) {
  Ordered out{{"name", mission.name}};
  if (mission.site) out["site"] = to_string(*mission.site);
  if (!mission.kit.empty()) out["kit"] = mission.kit;
  if (!mission.radio.empty()) out["radio"] = mission.radio;
  out["frame"] = k_frame_words.word(mission.frame);
  out["track_point"] = k_point_words.word(mission.point);
  out["tags"] = Ordered::array();
  for (const TagAntenna& tag : mission.tags) {
    const auto& arm = tag.lever_arm_body_m;
    out["tags"].push_back({{"tag", to_string(tag.tag)},
                           {"antenna", tag.antenna},
                           {"lever_arm_body_m", {arm.x(), arm.y(), arm.z()}}});
  }
  if (mission.lever_arm_sigma_m) out["lever_arm_sigma_m"] = *mission.lever_arm_sigma_m;
  return dumped(out);
}

void append_ndjson(std::string& body, const Range& row) {
  append_range(body, row, std::nullopt, true, {});
  body += '\n';
}

void append_ndjson(std::string& body, const Fix& row) {
  append_fix(body, row, std::nullopt);
  body += '\n';
}

Result<IngestAnswer> parse_ingest_answer(std::string_view body) {
  const Json json = parsed(body);
  const auto count = [&](const char* key) -> std::optional<std::uint64_t> {
    if (!json.is_object()) return std::nullopt;
    const auto it = json.find(key);
    if (it == json.end() || !it->is_number_unsigned()) return std::nullopt;
    return it->get<std::uint64_t>();
  };
  const auto accepted = count("accepted");
  const auto duplicates = count("duplicates");
  const auto rejected = count("rejected");
  if (!accepted || !duplicates || !rejected) {
    return make_error(Errc::bad_frame, "not the answer of an ingest: " + to_utf8(body, 200));
  }
  IngestAnswer answer{*accepted, *duplicates, *rejected, {}};
  const auto errors = json.find("errors");
  if (errors != json.end() && errors->is_array() && !errors->empty()) {
    const Json& first = errors->front();
    answer.first_error = text_of(first, "code") + ": " + text_of(first, "detail");
  }
  return answer;
}

Result<std::string> parse_created_id(std::string_view body) {
  std::string id = text_of(parsed(body), "id");
  if (id.empty()) return make_error(Errc::bad_frame, "an answer without an id: " + to_utf8(body, 200));
  return id;
}

std::string problem_text(std::string_view body) {
  const Json json = parsed(body);
  std::string text = text_of(json, "detail");
  if (text.empty()) text = text_of(json, "title");
  if (json.is_object() && json.contains("errors") && json["errors"].is_array() && !json["errors"].empty()) {
    const Json& first = json["errors"].front();
    text += " (" + text_of(first, "pointer") + ": " + text_of(first, "detail") + ")";
  }
  return text.empty() ? to_utf8(body, 200) : text;
}

}  // namespace anchord::api
