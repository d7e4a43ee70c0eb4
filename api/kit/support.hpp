#pragma once

#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "api/kit/problem.hpp"
#include "api/kit/router.hpp"
#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord::api {

/// Everybody who may read (V of api.md section 6; integrator, engineer and operator include it, gateway does
/// not).
Access readers();

Response json_response(int status, const nlohmann::ordered_json& body,
                       std::string_view content_type = "application/json");
/// 422 for a query parameter that the route does not have: a typo is how a filter gets lost.
void check_query(const Request& request, std::initializer_list<std::string_view> allowed);

struct PageQuery {
  std::size_t limit{100};
  std::string cursor;
};
PageQuery page_query(const Request& request, std::size_t max_limit = 1000);
/// {"items":[...],"next_cursor":...} with Link rel="next"; `fields=a,b` keeps only these members.
/// `total` only where the client asked for a count.
Response list_response(const Request& request, nlohmann::ordered_json items, const std::string& next_cursor,
                       std::optional<std::uint64_t> total = std::nullopt);
/// A part of a query: unreserved characters of RFC 3986 stay.
std::string percent_encoded(std::string_view text);
std::string next_link(const Request& request, const std::string& next_cursor);

/// The path parameter as an id; 404 when it is none, for then there is nothing at this address.
Uuid path_uuid(const Request& request, const char* name = "id");
template <class I>
I path_id(const Request& request, const char* name = "id") {
  return I{path_uuid(request, name)};
}
template <class I>
std::optional<I> cursor_id(const std::string& cursor) {
  if (cursor.empty()) return std::nullopt;
  const auto id = parse_uuid(cursor);
  if (!id)
    throw_problem(422, "validation", "cursor is not one of ours",
                  {{"/cursor", "bad_cursor", "is not one of ours"}});
  return I{id.value()};
}
/// `reason` of a body that has nothing else and may be absent; empty without.
std::string optional_reason(const Request& request);
/// RFC 3339 or integer microseconds.
std::optional<UtcTime> query_time(const Request& request, const char* name);
std::optional<MissionId> query_mission(const Request& request);
std::optional<NetworkId> query_network_id(const Request& request, const char* name);
bool query_flag(const Request& request, const char* name);
/// 422 with the words that may be used.
[[noreturn]] void refuse_query_word(const char* name, std::span<const std::string_view> words);
/// The value of a word of the table; nothing where it is not given.
template <class T, std::size_t N>
std::optional<T> query_word(const Request& request, const char* name, const EnumTable<T, N>& table) {
  const auto word = request.query_value(name);
  if (!word) return std::nullopt;
  const auto value = table.find(*word);
  if (!value) refuse_query_word(name, table.words());
  return value;
}
/// 422 outside of low..high.
std::optional<double> query_number(const Request& request, const char* name, double low, double high);

/// 412, with the present ETag, unless If-Match names it.
void require_match(const Request& request, const std::string& etag);
/// "json", "geojson", "csv", "ndjson": of ?format= or else Accept; the first offer where neither decides. 406
/// when nothing fits.
std::string negotiate(const Request& request, std::initializer_list<std::string_view> offers);
/// Seconds of `Prefer: wait=n`, 0 without, at most 600.
int prefer_wait_s(const Request& request);

}  // namespace anchord::api
