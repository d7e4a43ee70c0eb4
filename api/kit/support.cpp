#include "api/kit/support.hpp"

#include <algorithm>
#include <charconv>
#include <compare>
#include <nlohmann/json.hpp>
#include <set>

#include "api/kit/contract_fields.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

[[noreturn]] void bad_query(const char* name, std::string detail) {
  throw_problem(422, "validation", std::string(name) + " " + detail,
                {{std::string("/") + name, "bad_value", detail}});
}

}  // namespace

std::string percent_encoded(std::string_view text) {
  static constexpr char k_hex[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.' || c == '~';
    if (plain)
      out += c;
    else {
      out += '%';
      out += k_hex[byte >> 4];
      out += k_hex[byte & 15];
    }
  }
  return out;
}

Access readers() { return Access::any_of({Role::viewer, Role::integrator, Role::engineer, Role::op}); }

Response json_response(int status, const Ordered& body, std::string_view content_type) {
  Response response;
  response.status = status;
  response.header("Content-Type", std::string(content_type));
  response.body = to_wire(body);
  return response;
}

void check_query(const Request& request, std::initializer_list<std::string_view> allowed) {
  std::vector<FieldError> errors;
  for (const auto& [key, value] : request.query) {
    if (std::find(allowed.begin(), allowed.end(), key) == allowed.end())
      errors.push_back({"/" + to_utf8(key, 60), "unknown_field", "no such query parameter"});
  }
  if (!errors.empty()) throw_problem(422, "validation", "unknown query parameter", errors);
}

PageQuery page_query(const Request& request, std::size_t max_limit) {
  PageQuery page;
  page.cursor = request.query_value("cursor").value_or("");
  if (const auto text = request.query_value("limit")) {
    const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), page.limit);
    if (error != std::errc{} || end != text->data() + text->size() || page.limit < 1 ||
        page.limit > max_limit)
      bad_query("limit", "must be 1.." + std::to_string(max_limit));
  }
  return page;
}

std::string next_link(const Request& request, const std::string& next_cursor) {
  std::string url = request.path + "?";
  for (const auto& [key, value] : request.query) {
    if (key != "cursor") url += percent_encoded(key) + '=' + percent_encoded(value) + '&';
  }
  return '<' + url + "cursor=" + percent_encoded(next_cursor) + ">; rel=\"next\"";
}

namespace {

/// The path as the contract has it: "/api/v1/campaigns/{id}/samples".
std::string contract_path(const Request& request) {
  std::string path = request.path;
  for (const auto& [name, value] : request.params) {
    if (const auto at = path.find('/' + value); at != std::string::npos)
      path.replace(at + 1, value.size(), '{' + name + '}');
  }
  return path;
}

/// A name that no item can have is a slip of the hand: said, and not answered with less than was asked for.
std::set<std::string> wanted_fields(const Request& request, const std::string& list) {
  const auto known = item_fields(contract_path(request));
  std::set<std::string> wanted;
  for (std::size_t from = 0; from <= list.size();) {
    const std::size_t end = std::min(list.find(',', from), list.size());
    const std::string name = list.substr(from, end - from);
    if (!known.empty() && !known.contains(name)) {
      std::string all;
      for (const auto& each : known) all += (all.empty() ? "" : ", ") + each;
      bad_query("fields", "has an unknown name: \"" + to_utf8(name, 60) + "\"; known are " + all);
    }
    wanted.insert(name);
    from = end + 1;
  }
  return wanted;
}

}  // namespace

Response list_response(const Request& request, Ordered items, const std::string& next_cursor,
                       std::optional<std::uint64_t> total) {
  if (const auto fields = request.query_value("fields")) {
    const auto wanted = wanted_fields(request, *fields);
    for (auto& item : items) {
      Ordered kept = Ordered::object();
      for (auto& [key, value] : item.items()) {
        if (wanted.contains(key)) kept[key] = std::move(value);
      }
      item = std::move(kept);
    }
  }
  Ordered body;
  body["items"] = std::move(items);
  body["next_cursor"] = next_cursor.empty() ? Ordered(nullptr) : Ordered(next_cursor);
  if (total) body["total"] = *total;
  Response response = json_response(200, body);
  if (!next_cursor.empty()) response.header("Link", next_link(request, next_cursor));
  return response;
}

Uuid path_uuid(const Request& request, const char* name) {
  const auto it = request.params.find(name);
  const auto id = parse_uuid(it == request.params.end() ? "" : it->second);
  if (!id) throw_problem(404, "not-found", "there is nothing at this address");
  return id.value();
}

std::string optional_reason(const Request& request) {
  std::vector<FieldError> errors;
  const auto body = json_body(request, true);
  Fields fields(body, "", errors);
  auto reason = fields.text("reason", record_limits::k_reason).value_or("");
  fields.finish();
  refuse_if_any(errors);
  return reason;
}

std::optional<UtcTime> query_time(const Request& request, const char* name) {
  const auto text = request.query_value(name);
  if (!text) return std::nullopt;
  std::int64_t us = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), us);
  if (error == std::errc{} && end == text->data() + text->size() && us >= 0 && us <= 4'102'444'800'000'000)
    return UtcTime::from_us(us);
  const auto time = parse_rfc3339(*text);
  if (!time) bad_query(name, "must be RFC 3339 with Z, or microseconds");
  return time.value();
}

std::optional<double> query_number(const Request& request, const char* name, double low, double high) {
  const auto text = request.query_value(name);
  if (!text) return std::nullopt;
  double value = 0;
  const auto [end, status] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (status != std::errc{} || end != text->data() + text->size() || !(value >= low && value <= high)) {
    const auto bound = [](double x) { return to_wire(Json(x)); };
    bad_query(name, "must be a number, " + bound(low) + ".." + bound(high));
  }
  return value;
}

std::optional<MissionId> query_mission(const Request& request) {
  const auto text = request.query_value("mission");
  if (!text) return std::nullopt;
  const auto id = parse_uuid(*text);
  if (!id) bad_query("mission", "must be the id of a mission");
  return MissionId{id.value()};
}

std::optional<NetworkId> query_network_id(const Request& request, const char* name) {
  const auto text = request.query_value(name);
  if (!text) return std::nullopt;
  const auto id = parse_network_id(*text);
  if (!id) bad_query(name, "must be a network id like 0x6a2f");
  return id.value();
}

bool query_flag(const Request& request, const char* name) {
  const auto text = request.query_value(name);
  if (!text || *text == "false" || *text == "0") return false;
  if (*text != "true" && *text != "1") bad_query(name, "must be true or false");
  return true;
}

/// RFC 9110 section 13.1.1: any of a list, by strong comparison, so W/"1" is not "1".
bool names_etag(std::string_view list, std::string_view etag) {
  while (!list.empty()) {
    const auto begin = list.find_first_not_of(" \t,");
    if (begin == std::string_view::npos) return false;
    list.remove_prefix(begin);
    const auto quote = list.find('"'),
               close = quote == std::string_view::npos ? quote : list.find('"', quote + 1);
    const auto end = close == std::string_view::npos ? list.find(',') : close + 1;
    const auto one = list.substr(0, end);
    if (one == etag || one == "*") return true;
    list.remove_prefix(std::min(list.size(), one.size()));
  }
  return false;
}

void require_match(const Request& request, const std::string& etag) {
  if (names_etag(request.header("if-match"), etag)) return;
  Response response =
      problem(412, "precondition-failed", "the resource changed since it was read; its ETag is now " + etag);
  response.header("ETag", etag);
  throw ProblemException{std::move(response)};
}

void refuse_query_word(const char* name, std::span<const std::string_view> words) {
  throw_problem(422, "validation", std::string(name) + " has an unknown value",
                {{std::string("/") + name, "unknown_value", "must be one of " + list_of(words)}});
}

namespace {

/// What Accept names: `text/csv;q=0.5` (RFC 9110, 12.5.1), in small letters.
struct MediaRange {
  std::string type;
  double quality{1};
};

std::vector<MediaRange> media_ranges(std::string_view accept) {
  std::vector<MediaRange> out;
  constexpr std::size_t k_most = 50;
  while (!accept.empty() && out.size() < k_most) {
    const auto comma = std::min(accept.find(','), accept.size());
    std::string one;
    for (const char c : accept.substr(0, comma))
      if (c != ' ' && c != '\t') one += c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    accept.remove_prefix(std::min(comma + 1, accept.size()));
    MediaRange range{one.substr(0, one.find(';'))};
    if (const auto q = one.find(";q="); q != std::string::npos) {
      const auto [end, error] = std::from_chars(one.data() + q + 3, one.data() + one.size(), range.quality);
      if (error != std::errc{} || !(range.quality >= 0 && range.quality <= 1)) range.quality = 0;
    }
    if (!range.type.empty()) out.push_back(std::move(range));
  }
  return out;
}

/// How much an offer is wanted: by quality, and of equal ones by how exactly it is named. Then it is ours to
/// choose.
struct Preference {
  double quality{0};
  int exactness{0};
  auto operator<=>(const Preference&) const = default;
};

/// The most exact range decides, as RFC 9110 has it. `usual`: what is given where nothing is asked for; it is
/// named by application/json too.
Preference preference(const std::vector<MediaRange>& ranges, std::string_view offer, bool usual) {
  static constexpr std::pair<std::string_view, std::string_view> k_types[]{
      {"geojson", "application/geo+json"},
      {"ndjson", "application/x-ndjson"},
      {"csv", "text/csv"},
      {"json", "application/json"},
      {"binary", "application/octet-stream"},
      {"kml", "application/vnd.google-earth.kml+xml"},
      {"gpkg", "application/geopackage+sqlite3"}};
  const auto known = std::ranges::find(k_types, offer, [](const auto& t) { return t.first; });
  const std::string_view type = known == std::end(k_types) ? std::string_view{} : known->second;
  Preference out;
  for (const auto& range : ranges) {
    const int exactness = !type.empty() && range.type == type         ? 4
                          : usual && range.type == "application/json" ? 3
                          : !type.empty() && range.type == std::string(type.substr(0, type.find('/'))) + "/*"
                              ? 2
                          : range.type == "*/*" ? 1
                                                : 0;
    if (exactness > out.exactness) out = {range.quality, exactness};
  }
  return out;
}

}  // namespace

std::string negotiate(const Request& request, std::initializer_list<std::string_view> offers) {
  const auto offered = [&](std::string_view word) {
    return std::find(offers.begin(), offers.end(), word) != offers.end();
  };
  if (const auto format = request.query_value("format")) {
    if (!offered(*format))
      throw_problem(406, "not-acceptable",
                    "this address does not support the format " + *format + "; it has " +
                        list_of({offers.begin(), offers.end()}));
    return *format;
  }
  const auto accept = request.header("accept");
  if (accept.empty()) return std::string(*offers.begin());
  const auto ranges = media_ranges(accept);
  std::string_view best;
  Preference of_best{};
  for (const auto offer : offers) {
    const auto wanted = preference(ranges, offer, offer == *offers.begin());
    if (wanted.quality > 0 && (best.empty() || wanted > of_best)) {
      best = offer;
      of_best = wanted;
    }
  }
  if (!best.empty()) return std::string(best);
  throw_problem(406, "not-acceptable",
                "none of the formats in Accept is available here; ?format= takes " +
                    list_of({offers.begin(), offers.end()}));
}

int prefer_wait_s(const Request& request) {
  const auto prefer = request.header("prefer");
  const auto at = prefer.find("wait=");
  if (at == std::string_view::npos) return 0;
  int seconds = 0;
  std::from_chars(prefer.data() + at + 5, prefer.data() + prefer.size(), seconds);
  return std::clamp(seconds, 0, 600);
}

}  // namespace anchord::api
