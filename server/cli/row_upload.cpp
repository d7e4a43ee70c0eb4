#include "server/cli/row_upload.hpp"

#include <utility>

#include "api/measurements/flight_requests.hpp"
#include "server/cli/rest_client.hpp"

namespace anchord::cli {

RowUpload::RowUpload(RestClient& client) : client_(client), thread_("anchord-upload", [this] { run(); }) {}

RowUpload::~RowUpload() {
  {
    const std::scoped_lock lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

Result<void> RowUpload::send(RowBatch batch) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !waiting_ || failed_; });
  if (failed_) return *failed_;
  waiting_ = std::move(batch);
  changed_.notify_all();
  return boost::outcome_v2::success();
}

Result<void> RowUpload::drain() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return (!waiting_ && !busy_) || failed_; });
  if (failed_) return *failed_;
  return boost::outcome_v2::success();
}

RowAnswers RowUpload::answers() const {
  const std::scoped_lock lock(mutex_);
  return answers_;
}

void RowUpload::run() {
  std::unique_lock lock(mutex_);
  while (!failed_) {
    changed_.wait(lock, [this] { return waiting_ || closing_; });
    if (!waiting_) return;
    const RowBatch batch = *std::exchange(waiting_, std::nullopt);
    busy_ = true;
    changed_.notify_all();
    lock.unlock();
    Result<void> done = boost::outcome_v2::success();
    if (const auto ran = guarded("upload", [&] { done = post(batch); }); !ran)
      done = make_error(Errc::internal, ran.what);
    lock.lock();
    busy_ = false;
    if (!done) failed_ = std::move(done).error();
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
  const std::scoped_lock lock(mutex_);
  answers_.accepted += answer.accepted;
  answers_.known += answer.duplicates;
  answers_.refused += answer.rejected;
  if ((answers_.*first_error).empty()) answers_.*first_error = answer.first_error;
  return boost::outcome_v2::success();
}

}  // namespace anchord::cli
