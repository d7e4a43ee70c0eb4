#include "server/gateway/answer.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>

#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"

namespace anchord::gateway {
namespace {

using Json = nlohmann::json;
using std::chrono::milliseconds;

constexpr milliseconds k_longest_wait = std::chrono::minutes(10);
constexpr milliseconds k_full_disk_wait = std::chrono::seconds(10);

std::string text_of(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string();
}

std::optional<std::uint64_t> count_of(const Json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end() || !at->is_number_unsigned()) return std::nullopt;
  return at->get<std::uint64_t>();
}

std::optional<Report> read_report(std::string_view body) {
  const auto json = Json::parse(body, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  const auto accepted = count_of(json, "accepted"), duplicates = count_of(json, "duplicates"),
             rejected = count_of(json, "rejected");
  if (!accepted || !duplicates || !rejected) return std::nullopt;
  Report out{*accepted, *duplicates, *rejected, {}, false};
  for (const auto& error : json.value("errors", Json::array())) {
    const auto line = error.is_object() ? count_of(error, "line") : std::nullopt;
    if (!line) continue;
    std::string detail = text_of(error, "detail");
    if (const auto pointer = text_of(error, "pointer"); !pointer.empty()) detail = pointer + ": " + detail;
    if (!out.errors.empty() && out.errors.back().line == *line)
      out.errors.back().detail += "; " + detail;
    else
      out.errors.push_back({*line, text_of(error, "code"), detail});
  }
  out.truncated = out.errors.size() != out.rejected;
  return out;
}

std::string told(int status, std::string_view body) {
  return std::to_string(status) + " " + api::problem_text(body);
}

Assessment waits(Link link, std::string why, std::optional<milliseconds> wait = std::nullopt) {
  return {Then::wait, link, std::move(why), wait, {}};
}

/// What every question has in common; nothing: a 2xx, or a 4xx that only the question can explain.
/// Unix time of a date as servers write it (RFC 9110 section 5.6.7).
std::optional<double> http_date_s(const std::string& text) {
  std::tm at{};
  const char* end = ::strptime(text.c_str(), "%a, %d %b %Y %H:%M:%S GMT", &at);
  if (end == nullptr || *end != '\0') return std::nullopt;
  return static_cast<double>(::timegm(&at));
}

std::optional<Assessment> assess_trouble(int status, const std::map<std::string, std::string>& headers,
                                         std::string_view body, UtcTime now) {
  const auto header = headers.find("retry-after");
  const auto asked = header == headers.end() ? std::nullopt : retry_after(header->second, now);
  switch (status) {
    case 401:
      return waits(
          Link::unauthorized,
          told(status, body) +
              ": the token is not (or no longer) valid on this server. Create one there with 'anchord token "
              "create --name NAME --role gateway --role viewer' and write it to the token file; it is read "
              "again at every attempt",
          asked);
    case 403:
      return waits(
          Link::unauthorized,
          told(status, body) +
              ": the token needs the role gateway to send rows, and viewer to see which mission records",
          asked);
    case 507:
      return waits(Link::busy, told(status, body) + ": free space on the server's disk",
                   asked ? asked : k_full_disk_wait);
    default:
      break;
  }
  if (status == 408 || status == 425 || status == 429 || status >= 500)
    return waits(Link::busy, told(status, body), asked);
  if (status < 200 || (status >= 300 && status < 400))
    return waits(
        Link::refused,
        told(status, body) +
            ": this is not the answer of an anchord server; is the address right, is there a login page?");
  return std::nullopt;
}

}  // namespace

std::optional<double> clock_ahead_s(const std::map<std::string, std::string>& headers, UtcTime sent,
                                    UtcTime received) {
  const auto header = headers.find("date");
  const auto date_s = header == headers.end() ? std::nullopt : http_date_s(header->second);
  if (!date_s) return std::nullopt;
  const double least_s = sent.seconds() - (*date_s + 1), most_s = received.seconds() - *date_s;
  return least_s > 0 ? least_s : std::min(most_s, 0.0);
}

std::optional<milliseconds> retry_after(std::string_view text, UtcTime now) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  std::int64_t seconds = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (read.ec != std::errc() || read.ptr != text.data() + text.size()) {
    const auto date_s = http_date_s(std::string(text));
    if (!date_s) return std::nullopt;
    seconds = static_cast<std::int64_t>(std::ceil(*date_s - now.seconds()));
  }
  if (seconds < 0) seconds = 0;
  return std::min<milliseconds>(std::chrono::seconds(std::min<std::int64_t>(seconds, 3600)), k_longest_wait);
}

Assessment assess(int status, const std::map<std::string, std::string>& headers, std::string_view body,
                  std::uint64_t n_rows, UtcTime now) {
  if (auto trouble = assess_trouble(status, headers, body, now)) return *std::move(trouble);
  if (status < 300 || status == 422) {
    if (auto report = read_report(body)) {
      if (report->accepted + report->duplicates + report->rejected == n_rows)
        return {Then::settled, Link::up, {}, std::nullopt, *std::move(report)};
      return waits(Link::refused,
                   "the answer is about " +
                       std::to_string(report->accepted + report->duplicates + report->rejected) +
                       " rows, but the number sent was " + std::to_string(n_rows));
    }
    if (status < 300)
      return waits(Link::refused,
                   told(status, body) + ": not the answer of an anchord server; is there a login page?");
  }
  if (status == 409 || status == 413) return {Then::halve, Link::up, told(status, body), std::nullopt, {}};
  if (status == 404 || status == 410) return {Then::hold, Link::up, told(status, body), std::nullopt, {}};
  return waits(Link::refused, told(status, body) + ": is the server older than this gateway?");
}

Assessment assess_question(int status, const std::map<std::string, std::string>& headers,
                           std::string_view body, UtcTime now) {
  if (auto trouble = assess_trouble(status, headers, body, now)) return *std::move(trouble);
  if (status < 300) return {Then::settled, Link::up, {}, std::nullopt, {}};
  return waits(Link::refused, told(status, body) + ": is this the address of an anchord server?");
}

milliseconds Pauses::next(double uniform) {
  const auto doubled = static_cast<double>(first_.count()) * std::pow(2.0, std::min(failures_, 16));
  ++failures_;
  const double most = std::min(doubled, static_cast<double>(longest_.count()));
  return milliseconds(static_cast<std::int64_t>(most * (0.75 + 0.5 * uniform)));
}

}  // namespace anchord::gateway
