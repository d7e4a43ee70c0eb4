#include "api/exchange/ogc_query.hpp"

#include <algorithm>
#include <charconv>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "api/kit/problem.hpp"
#include "api/kit/reader.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

[[noreturn]] void bad(const char* name, const std::string& rule) {
  throw_problem(400, "malformed", std::string(name) + ' ' + rule,
                {{std::string("/") + name, "bad_value", rule}});
}

void only(const Request& request, std::initializer_list<std::string_view> allowed) {
  for (const auto& [key, value] : request.query) {
    if (std::find(allowed.begin(), allowed.end(), key) == allowed.end())
      throw_problem(400, "malformed", "unknown query parameter " + to_utf8(key, 60),
                    {{"/" + to_utf8(key, 60), "unknown_field", "no such query parameter"}});
  }
  const auto format = request.query_value("f");
  if (format && *format != "json" && *format != "geojson")
    bad("f", "must be json: no other format is available");
}

OgcCrs named_crs(const Request& request, const char* name, bool heights) {
  const auto uri = request.query_value(name);
  if (!uri) return heights ? k_storage_crs : k_flat_crs;
  std::string all;
  for (const auto& crs : k_ogc_crs) {
    if (crs.has_height && !heights) continue;
    if (crs.uri == *uri) return crs;
    all += (all.empty() ? "" : ", ") + std::string(crs.uri);
  }
  bad(name, "must be one of " + all);
}

std::vector<double> numbers(const std::string& text) {
  nlohmann::json list;
  if (parse_json('[' + text + ']', list)) return {};
  std::vector<double> out;
  for (const auto& one : list) {
    if (!one.is_number()) return {};
    out.push_back(one);
  }
  return out;
}

OgcBox box_of(const Request& request, const std::string& text) {
  const auto crs = named_crs(request, "bbox-crs", true);
  auto n = numbers(text);
  if (n.size() != 4 && n.size() != 6)
    bad("bbox", "must be four numbers, or six with heights: west,south,east,north");
  constexpr double k_any = std::numeric_limits<double>::infinity();
  if (n.size() == 4) n = {n[0], n[1], -k_any, n[2], n[3], k_any};
  if (crs.latitude_first) {
    std::swap(n[0], n[1]);
    std::swap(n[3], n[4]);
  }
  if (n[1] > n[4] || n[2] > n[5]) bad("bbox", "has its lower corner above its upper one");
  return {lon_lat_box(n[0], n[1], n[3], n[4]), n[2], n[5]};
}

/// "+01:30" in minutes.
std::optional<int> offset_min(std::string_view text) {
  const auto digit = [&](std::size_t i) { return text[i] >= '0' && text[i] <= '9'; };
  if (text.size() != 6 || (text[0] != '+' && text[0] != '-') || text[3] != ':') return std::nullopt;
  if (!digit(1) || !digit(2) || !digit(4) || !digit(5)) return std::nullopt;
  const int hours = 10 * (text[1] - '0') + text[2] - '0', minutes = 10 * (text[4] - '0') + text[5] - '0';
  if (hours > 23 || minutes > 59) return std::nullopt;
  return (text[0] == '-' ? -1 : 1) * (60 * hours + minutes);
}

/// Also with an offset to UTC, as clients of OGC API send it.
std::optional<UtcTime> instant(std::string_view text) {
  if (text.empty() || text == "..") return std::nullopt;
  const auto offset = text.size() > 6 ? offset_min(text.substr(text.size() - 6)) : std::nullopt;
  auto time = parse_rfc3339(offset ? std::string(text.substr(0, text.size() - 6)) + 'Z' : std::string(text));
  if (!time) bad("datetime", "must be an RFC 3339 time, or two with / between them; .. is an open end");
  time.value().ns -= std::int64_t{60} * 1'000'000'000 * offset.value_or(0);
  return time.value();
}

/// Times are written in whole microseconds: what is named so is found by its own name.
UtcTime end_of_us(UtcTime time) { return UtcTime{(time.ns / 1000) * 1000 + 999}; }

OgcInterval interval_of(const std::string& text) {
  const auto slash = text.find('/');
  if (slash == std::string::npos) {
    const auto at = instant(text);
    if (!at) bad("datetime", "must be an RFC 3339 time, or two with / between them; .. is an open end");
    return {at, end_of_us(*at)};
  }
  OgcInterval out{instant(std::string_view(text).substr(0, slash)),
                  instant(std::string_view(text).substr(slash + 1))};
  if (out.to) out.to = end_of_us(*out.to);
  if (out.from && out.to && *out.from > *out.to) bad("datetime", "ends before it begins");
  return out;
}

}  // namespace

OgcQuery ogc_items_query(const Request& request, std::size_t usual, std::size_t maximum, bool heights) {
  only(request, {"limit", "cursor", "bbox", "bbox-crs", "datetime", "crs", "f"});
  OgcQuery out{usual, request.query_value("cursor").value_or(""), {}, {}, named_crs(request, "crs", heights)};
  if (const auto text = request.query_value("limit")) {
    const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), out.limit);
    if (error != std::errc{} || end != text->data() + text->size() || out.limit < 1)
      bad("limit", "must be 1.." + std::to_string(maximum));
    out.limit = std::min(out.limit, maximum);
  }
  if (const auto text = request.query_value("bbox")) out.box = box_of(request, *text);
  if (const auto text = request.query_value("datetime")) out.interval = interval_of(*text);
  return out;
}

OgcCrs ogc_item_query(const Request& request, bool heights) {
  only(request, {"crs", "f"});
  return named_crs(request, "crs", heights);
}

void ogc_document_query(const Request& request) { only(request, {"f"}); }

void reorder(nlohmann::ordered_json& coordinates, const OgcCrs& crs) {
  if (!coordinates.is_array() || coordinates.empty()) return;
  if (coordinates[0].is_array()) {
    for (auto& part : coordinates) reorder(part, crs);
    return;
  }
  if (crs.latitude_first) std::swap(coordinates[0], coordinates[1]);
  if (!crs.has_height && coordinates.size() > 2) coordinates.erase(2);
}

}  // namespace anchord::api
