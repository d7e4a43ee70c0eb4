#include "api/wire/exclusion_json.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_most_rows = 10'000;
constexpr std::int64_t k_latest_us = 4'102'444'800'000'000;  // the year 2100

template <class T>
Ordered or_null(const std::optional<T>& value) {
  return value ? Ordered(to_string(*value)) : Ordered(nullptr);
}

Ordered time_or_null(const std::optional<UtcTime>& time) {
  return time ? Ordered(to_rfc3339(*time)) : Ordered(nullptr);
}

Ordered row_json(RowKind kind, const RowKey& key) {
  Ordered out{{"t_us", key.time.us()}};
  if (kind == RowKind::fixes) return out;
  out["tag"] = to_string(key.tag);
  out["antenna"] = key.antenna;
  out["anchor"] = to_string(key.anchor);
  return out;
}

Ordered rows_json(const RowSelection& selection) {
  Ordered rows = Ordered::array();
  for (const auto& key : selection.rows) rows.push_back(row_json(selection.kind, key));
  return rows;
}

std::optional<UtcTime> read_time(Fields& fields, const char* key) {
  const Json* value = fields.child(key);
  if (value == nullptr) return std::nullopt;
  if (value->is_number_integer()) {
    const auto us = value->get<std::int64_t>();
    if (us >= 0 && us <= k_latest_us) return UtcTime::from_us(us);
  } else if (value->is_string()) {
    if (const auto time = parse_rfc3339(value->get_ref<const std::string&>())) return time.value();
  }
  fields.error(key, "bad_value", "must be RFC 3339 with Z, or microseconds");
  return std::nullopt;
}

std::optional<NetworkId> read_id(Fields& fields, const char* key) {
  const auto text = fields.text(key, 20);
  if (!text) return std::nullopt;
  const auto id = parse_network_id(*text);
  if (id) return id.value();
  fields.error(key, "bad_id", id.error().message);
  return std::nullopt;
}

void read_rows(Fields& fields, RowSelection& selection, std::vector<FieldError>& errors) {
  const Json* rows = fields.child("rows");
  if (rows == nullptr) return;
  if (!rows->is_array() || rows->empty() || rows->size() > k_most_rows)
    return fields.error("rows", "wrong_type", "must be an array of 1 to 10000 rows");
  for (std::size_t i = 0; i < rows->size() && errors.size() < 100; ++i) {
    Fields row((*rows)[i], "/rows/" + std::to_string(i), errors);
    RowKey key;
    if (const auto time = row.integer("t_us", 0, k_latest_us, true)) key.time = UtcTime::from_us(*time);
    if (selection.kind == RowKind::ranges) {
      key.tag = read_id(row, "tag").value_or(NetworkId{});
      key.anchor = read_id(row, "anchor").value_or(NetworkId{});
      key.antenna = static_cast<std::uint8_t>(row.integer("antenna", 0, 255).value_or(0));
    }
    row.finish();
    selection.rows.push_back(key);
  }
  std::ranges::sort(selection.rows);
}

void read_ids(Fields& fields, std::vector<std::int64_t>& ids) {
  const Json* list = fields.child("ids");
  if (list == nullptr) return;
  const bool good = list->is_array() && !list->empty() && list->size() <= k_most_rows &&
                    std::ranges::all_of(*list, [](const Json& id) { return id.is_number_unsigned(); });
  if (!good) return fields.error("ids", "wrong_type", "must be an array of 1 to 10000 row ids");
  for (const auto& id : *list) ids.push_back(id.get<std::int64_t>());
}

}  // namespace

Ordered exclusion_json(const Exclusion& e) {
  const auto& s = e.selection;
  Ordered out{{"id", to_string(e.id)},
              {"mission", to_string(e.mission)},
              {"kind", k_row_kind_words.word(s.kind)},
              {"rows", rows_json(s)},
              {"since", time_or_null(s.since)},
              {"until", time_or_null(s.until)},
              {"anchor", or_null(s.anchor)},
              {"tag", or_null(s.tag)},
              {"n_rows", e.n_rows},
              {"reason", e.reason},
              {"by", e.by},
              {"created_at", to_rfc3339(e.created)}};
  out["included"] = e.included ? Ordered{{"by", e.included->by},
                                         {"reason", e.included->reason},
                                         {"at", to_rfc3339(e.included->time)}}
                               : Ordered(nullptr);
  return out;
}

std::string exclusion_canonical(const Exclusion& e) {
  const auto& s = e.selection;
  return to_wire(Ordered{{"id", to_string(e.id)},
                         {"kind", k_row_kind_words.word(s.kind)},
                         {"rows", rows_json(s)},
                         {"since", time_or_null(s.since)},
                         {"until", time_or_null(s.until)},
                         {"anchor", or_null(s.anchor)},
                         {"tag", or_null(s.tag)}}) +
         '\n';
}

ExclusionRequest read_exclusion_request(const Json& body, std::vector<FieldError>& errors) {
  ExclusionRequest out;
  Fields fields(body, "", errors);
  auto& s = out.selection;
  s.kind = fields.word("kind", k_row_kind_words, true).value_or(RowKind::ranges);
  read_ids(fields, out.ids);
  read_rows(fields, s, errors);
  s.since = read_time(fields, "since");
  s.until = read_time(fields, "until");
  s.anchor = read_id(fields, "anchor");
  s.tag = read_id(fields, "tag");
  out.reason = fields.text("reason", record_limits::k_reason, true).value_or("");
  if (fields.has("reason") && out.reason.find_first_not_of(" \t\r\n") == std::string::npos)
    fields.error("reason", "required",
                 "give a reason: it is shown in the list of exclusions and in every calibration");
  const int ways = (out.ids.empty() ? 0 : 1) + (s.rows.empty() ? 0 : 1) +
                   (s.since || s.until || s.anchor || s.tag ? 1 : 0);
  fields.finish();
  if (!errors.empty()) return out;
  if (ways != 1)
    errors.push_back({"/ids", "required", "send ids, or rows, or a span (since, until, anchor, tag)"});
  if (s.since && s.until && !(*s.since < *s.until))
    errors.push_back({"/until", "out_of_range", "must be after since"});
  if (s.kind == RowKind::fixes && (s.anchor || s.tag))
    errors.push_back({"/anchor", "unknown_field", "positions have no anchor and no tag"});
  return out;
}

std::string exclusion_request_json(const Exclusion& e) {
  const auto& s = e.selection;
  Ordered out{{"kind", k_row_kind_words.word(s.kind)}, {"reason", e.reason}};
  if (!s.rows.empty()) out["rows"] = rows_json(s);
  if (s.since) out["since"] = s.since->us();
  if (s.until) out["until"] = s.until->us();
  if (s.anchor) out["anchor"] = to_string(*s.anchor);
  if (s.tag) out["tag"] = to_string(*s.tag);
  return to_wire(out);
}

}  // namespace anchord::api

namespace anchord {

std::string exclusions_file_json(const std::vector<Exclusion>& exclusions) {
  nlohmann::ordered_json items = nlohmann::ordered_json::array();
  for (const auto& e : exclusions) {
    auto item = nlohmann::ordered_json::parse(api::exclusion_request_json(e));
    item["by"] = e.by;
    item["created_at"] = to_rfc3339(e.created);
    if (e.included)
      item["included"] = {
          {"by", e.included->by}, {"reason", e.included->reason}, {"at", to_rfc3339(e.included->time)}};
    items.push_back(std::move(item));
  }
  return to_wire(nlohmann::ordered_json{{"schema", "anchord.exclusions/1"}, {"exclusions", std::move(items)}},
                 1) +
         '\n';
}

Result<std::vector<Exclusion>> parse_exclusions_file(std::string_view text) {
  const auto bad = [](std::string why) {
    return make_error(Errc::invalid_argument, "exclusions.json: " + std::move(why));
  };
  auto file = nlohmann::json::parse(text, nullptr, false);
  if (!file.is_object() || file.value("schema", "") != "anchord.exclusions/1" ||
      !file.contains("exclusions") || !file["exclusions"].is_array())
    return bad("not of schema anchord.exclusions/1");
  std::vector<Exclusion> out;
  for (auto& item : file["exclusions"]) {
    const std::string at = "/exclusions/" + std::to_string(out.size());
    if (!item.is_object()) return bad(at + " is not an object");
    Exclusion e;
    const auto word_of = [&](nlohmann::json& from, const char* key) {
      const auto found = from.find(key);
      const std::string value = found != from.end() && found->is_string() ? found->get<std::string>() : "";
      from.erase(key);
      return value;
    };
    e.by = word_of(item, "by");
    if (const auto time = parse_rfc3339(word_of(item, "created_at"))) e.created = time.value();
    if (item.contains("included") && item["included"].is_object()) {
      auto& told = item["included"];
      e.included = Exclusion::Included{};
      e.included->by = word_of(told, "by");
      e.included->reason = word_of(told, "reason");
      if (const auto time = parse_rfc3339(word_of(told, "at"))) e.included->time = time.value();
    }
    item.erase("included");
    std::vector<api::FieldError> errors;
    auto request = api::read_exclusion_request(item, errors);
    if (errors.empty() && !request.ids.empty())
      errors.push_back({"/ids", "unknown_field", "exist only on a server; give rows"});
    if (!errors.empty()) return bad(at + errors.front().pointer + ": " + errors.front().detail);
    e.selection = std::move(request.selection);
    e.reason = std::move(request.reason);
    e.n_rows = e.selection.rows.size();
    out.push_back(std::move(e));
  }
  return out;
}

}  // namespace anchord
