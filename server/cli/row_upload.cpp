#include "server/cli/row_upload.hpp"

#include <utility>

#include "api/measurements/flight_requests.hpp"
#include "server/cli/rest_client.hpp"

namespace anchord::cli {

RowUpload::RowUpload(RestClient& client) : client_(client), thread_("anchord-upload", [this] { run(); }) {}

RowUpload::~RowUpload() {
  {
    auto state = state_.lock();
    state->closing = true;
  }
  changed_.notify_all();
  thread_.join();
}

Result<void> RowUpload::send(RowBatch batch) {
  auto state = state_.lock();
  state.wait(changed_, [](const State& s) { return !s.waiting || s.failed; });
  if (auto failed = state->failed) return *std::move(failed);
  state->waiting = std::move(batch);
  changed_.notify_all();
  return boost::outcome_v2::success();
}

Result<void> RowUpload::drain() {
  auto state = state_.lock();
  state.wait(changed_, [](const State& s) { return (!s.waiting && !s.busy) || s.failed; });
  if (auto failed = state->failed) return *std::move(failed);
  return boost::outcome_v2::success();
}

RowAnswers RowUpload::answers() const {
  const auto state = state_.lock();
  return state->answers;
}

void RowUpload::run() {
  auto state = state_.lock();
  while (!state->failed) {
    state.wait(changed_, [](const State& s) { return s.waiting || s.closing; });
    const auto batch = std::exchange(state->waiting, std::nullopt);
    if (!batch) return;
    state->busy = true;
    changed_.notify_all();
    Result<void> done = boost::outcome_v2::success();
    state.unlocked([&] {
      if (const auto ran = guarded("upload", [&] { done = post(*batch); }); !ran)
        done = make_error(Errc::internal, ran.what);
    });
    state->busy = false;
    if (!done) state->failed = std::move(done).error();
    changed_.notify_all();
  }
}

Result<void> RowUpload::post(const RowBatch& batch) {
  BOOST_OUTCOME_TRY(post_rows("/api/v1/fixes", batch.fixes, &RowAnswers::first_error_fixes));
  return post_rows("/api/v1/ranges", batch.ranges, &RowAnswers::first_error_ranges);
}

Result<void> RowUpload::post_rows(const std::string& path, const std::string& lines,
                                  std::string RowAnswers::*first_error) {
  if (lines.empty()) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(const auto body, client_.post(path, "application/x-ndjson", lines));
  BOOST_OUTCOME_TRY(const auto answer, api::parse_ingest_answer(body));
  auto state = state_.lock();
  state->answers.accepted += answer.accepted;
  state->answers.known += answer.duplicates;
  state->answers.refused += answer.rejected;
  auto& first = state->answers.*first_error;
  if (first.empty()) first = answer.first_error;
  return boost::outcome_v2::success();
}

}  // namespace anchord::cli
