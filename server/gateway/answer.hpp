#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/time.hpp"

namespace anchord::gateway {

/// How the server is reached.
enum class Link : std::uint8_t {
  unknown,       ///< not asked yet
  up,            ///< the last answer was one of an anchord that takes rows
  lost,          ///< no connection, no answer in time
  busy,          ///< 429, 503 and other troubles of the server: it says wait
  unauthorized,  ///< 401, 403: the token is of no use
  refused,       ///< an answer that no anchord gives to rows: another program, another version, a login page
};
inline constexpr auto k_link_words = enum_table<Link>({{"unknown", Link::unknown},
                                                       {"up", Link::up},
                                                       {"lost", Link::lost},
                                                       {"busy", Link::busy},
                                                       {"unauthorized", Link::unauthorized},
                                                       {"refused", Link::refused}});

/// What is to be done with rows that were sent.
enum class Then : std::uint8_t {
  settled,  ///< the report says what became of each
  halve,    ///< too large, or in conflict as a whole: each half alone; one row alone is rejected
  hold,     ///< the server does not know this mission: its rows wait, others go on
  wait,     ///< all stay; again later
};

struct RejectedLine {
  std::uint64_t line{};  ///< of the body, from 1
  std::string code, detail;
};
/// What an ingest answers.
struct Report {
  std::uint64_t accepted{}, duplicates{}, rejected{};
  std::vector<RejectedLine> errors;  ///< each line once, with all that is wrong with it
  bool truncated{false};             ///< not every rejected line is named
};

struct Assessment {
  Then then{Then::wait};
  Link link{Link::refused};
  std::string why{};                                ///< in words, with what to do; empty when settled
  std::optional<std::chrono::milliseconds> wait{};  ///< the server asks for it
  Report report{};                                  ///< of settled
};

/// Reads the answer to a request with rows. A 2xx is believed only with a report about just so many rows:
/// pages of networks that want a login answer 200 to everything. Pure.
Assessment assess(int status, const std::map<std::string, std::string>& headers, std::string_view body,
                  std::uint64_t n_rows, UtcTime now);

/// The same for a question of which nothing but the answer's body is wanted: settled is a 2xx.
Assessment assess_question(int status, const std::map<std::string, std::string>& headers,
                           std::string_view body, UtcTime now);

/// Retry-After: seconds or an HTTP date, at most ten minutes. Nothing: there is none, or it cannot be read.
std::optional<std::chrono::milliseconds> retry_after(std::string_view text, UtcTime now);

/// How far the clock here is ahead of the server's, negative behind it, by the Date of an answer (RFC 9110
/// section 6.6.1, whole seconds): as much as the delay cannot explain. Nothing without a date.
std::optional<double> clock_ahead_s(const std::map<std::string, std::string>& headers, UtcTime sent,
                                    UtcTime received);

/// Pauses between attempts that double, each drawn from three quarters to five quarters of it, so that
/// gateways of one server do not come all at once.
class Pauses {
 public:
  Pauses(std::chrono::milliseconds first, std::chrono::milliseconds longest)
      : first_(first), longest_(longest) {}
  /// `uniform` of [0, 1).
  std::chrono::milliseconds next(double uniform);
  void reset() { failures_ = 0; }
  int failures() const { return failures_; }

 private:
  std::chrono::milliseconds first_, longest_;
  int failures_{0};
};

}  // namespace anchord::gateway
