#pragma once

#include <condition_variable>
#include <cstdint>
#include <optional>
#include <string>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"

namespace anchord::cli {

class RestClient;

/// Lines of fixes and ranges that go to the server together.
struct RowBatch {
  std::string fixes, ranges;
  int n{0};
};

/// What the server said of the rows so far.
struct RowAnswers {
  std::uint64_t accepted{}, known{}, refused{};
  std::string first_error_fixes, first_error_ranges;
};

/// Sends batches in their order on a thread of its own, fixes before ranges, while the next is being derived.
/// One batch is under way and one waits; who brings a third waits for room. Everything it tells its owner, it
/// tells on the owner's thread; the client is the thread's own between send() and drain().
class RowUpload {
 public:
  explicit RowUpload(RestClient& client);
  ~RowUpload();
  RowUpload(const RowUpload&) = delete;
  RowUpload& operator=(const RowUpload&) = delete;

  /// errors: those of an earlier batch, after which nothing more is sent
  Result<void> send(RowBatch batch);
  /// Waits until all is answered.
  Result<void> drain();
  RowAnswers answers() const;

 private:
  void run();
  Result<void> post(const RowBatch& batch);
  Result<void> post_rows(const std::string& path, const std::string& lines,
                         std::string RowAnswers::*first_error);

  struct State {
    std::optional<RowBatch> waiting;
    bool busy{false}, closing{false};
    std::optional<Error> failed;
    RowAnswers answers;
  };

  RestClient& client_;
  Locked<State> state_;
  std::condition_variable changed_;
  Thread thread_;
};

}  // namespace anchord::cli
