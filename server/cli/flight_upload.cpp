#include "server/cli/flight_upload.hpp"

#include <algorithm>
#include <limits>

#include "api/measurements/flight_requests.hpp"

namespace anchord::cli {
namespace {

template <class Row>
void sort_and_number(std::vector<Row>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].seq) rows[i].seq = i;
  }
  std::ranges::stable_sort(rows, {}, &Row::time);
}

template <class Row>
std::size_t end_before(const std::vector<Row>& rows, std::size_t from, UtcTime until) {
  const auto it = std::ranges::lower_bound(rows.begin() + static_cast<std::ptrdiff_t>(from), rows.end(),
                                           until, {}, &Row::time);
  return static_cast<std::size_t>(it - rows.begin());
}

}  // namespace

void prepare_rows(FlightData& flight) {
  sort_and_number(flight.fixes);
  sort_and_number(flight.ranges);
}

FlightUpload::FlightUpload(RestClient& client, FlightData flight)
    : client_(client), flight_(std::move(flight)) {}

Result<void> FlightUpload::create_mission(const std::string& name) {
  flight_.mission.name = name;
  const std::string key = to_string(make_uuid_v7(SystemClock{}.now()));
  BOOST_OUTCOME_TRY(const auto body, client_.post("/api/v1/missions?devices=false", "application/json",
                                                  api::mission_request_json(flight_.mission), key));
  BOOST_OUTCOME_TRY(const auto id, api::parse_created_id(body));
  return use_mission(id);
}

Result<void> FlightUpload::use_mission(const std::string& id) {
  mission_id_ = id;
  BOOST_OUTCOME_TRY(const auto uuid, parse_uuid(mission_id_));
  for (Fix& fix : flight_.fixes) fix.mission = MissionId{uuid};
  for (Range& range : flight_.ranges) range.mission = MissionId{uuid};
  return boost::outcome_v2::success();
}

template <class Row>
Result<void> FlightUpload::post_rows(const char* path, std::span<Row> rows) {
  while (!rows.empty()) {
    const auto batch = rows.subspan(0, std::min(rows.size(), k_batch_rows));
    std::string body;
    for (const Row& row : batch) api::append_ndjson(body, row);
    BOOST_OUTCOME_TRY(const auto text, client_.post(path, "application/x-ndjson", body));
    BOOST_OUTCOME_TRY(const auto answer, api::parse_ingest_answer(text));
    accepted_ += answer.accepted;
    duplicates_ += answer.duplicates;
    rejected_ += answer.rejected;
    if (first_error_.empty()) first_error_ = answer.first_error;
    rows = rows.subspan(batch.size());
  }
  return boost::outcome_v2::success();
}

Result<void> FlightUpload::send_before(UtcTime until) {
  const std::size_t end_fix = end_before(flight_.fixes, next_fix_, until);
  const std::size_t end_range = end_before(flight_.ranges, next_range_, until);
  // Fixes first: a range waits on the server for the fix after it.
  BOOST_OUTCOME_TRY(
      post_rows("/api/v1/fixes", std::span(flight_.fixes).subspan(next_fix_, end_fix - next_fix_)));
  next_fix_ = end_fix;
  BOOST_OUTCOME_TRY(
      post_rows("/api/v1/ranges", std::span(flight_.ranges).subspan(next_range_, end_range - next_range_)));
  next_range_ = end_range;
  return boost::outcome_v2::success();
}

Result<void> FlightUpload::send_next_batch() {
  UtcTime until{std::numeric_limits<std::int64_t>::max()};
  // Never far ahead with one kind: the next batch ends where the fuller one of the two would.
  if (next_fix_ + k_batch_rows < flight_.fixes.size()) until = flight_.fixes[next_fix_ + k_batch_rows].time;
  if (next_range_ + k_batch_rows < flight_.ranges.size()) {
    until = std::min(until, flight_.ranges[next_range_ + k_batch_rows].time);
  }
  const std::size_t before = next_fix_ + next_range_;
  BOOST_OUTCOME_TRY(send_before(until));
  // More than a batch of rows at one instant: go past it.
  if (next_fix_ + next_range_ == before) return send_before(UtcTime{until.ns + 1});
  return boost::outcome_v2::success();
}

Result<void> FlightUpload::finish_mission() {
  BOOST_OUTCOME_TRY(client_.post("/api/v1/missions/" + mission_id_ + "/actions", "application/json",
                                 R"({"action":"finish"})", "finish-" + mission_id_));
  return boost::outcome_v2::success();
}

void FlightUpload::shift(std::int64_t offset_ns) {
  for (Fix& fix : flight_.fixes) fix.time.ns += offset_ns;
  for (Range& range : flight_.ranges) range.time.ns += offset_ns;
}

UtcTime FlightUpload::first() const {
  UtcTime time{std::numeric_limits<std::int64_t>::max()};
  if (!flight_.fixes.empty()) time = flight_.fixes.front().time;
  if (!flight_.ranges.empty()) time = std::min(time, flight_.ranges.front().time);
  return time;
}

UtcTime FlightUpload::last() const {
  UtcTime time{std::numeric_limits<std::int64_t>::min()};
  if (!flight_.fixes.empty()) time = flight_.fixes.back().time;
  if (!flight_.ranges.empty()) time = std::max(time, flight_.ranges.back().time);
  return time;
}

double FlightUpload::fraction() const {
  const auto all = static_cast<double>(flight_.fixes.size() + flight_.ranges.size());
  return all > 0 ? static_cast<double>(next_fix_ + next_range_) / all : 1.0;
}

std::string FlightUpload::summary() const {
  std::string text = std::to_string(accepted_) + " rows accepted, " + std::to_string(duplicates_) +
                     " duplicates, " + std::to_string(rejected_) + " rejected";
  if (!first_error_.empty()) text += " (first: " + first_error_ + ")";
  return text;
}

}  // namespace anchord::cli
