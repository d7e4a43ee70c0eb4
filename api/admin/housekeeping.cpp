#include "api/admin/housekeeping.hpp"

#include <algorithm>
#include <chrono>

#include "api/admin/cir_retention.hpp"
#include "api/admin/event_log.hpp"
#include "api/admin/running_time.hpp"
#include "core/ports/mission_bin.hpp"

namespace anchord::api {
namespace {

using Steady = std::chrono::steady_clock;

constexpr auto k_every = std::chrono::seconds(60);
constexpr auto k_pause = std::chrono::milliseconds(40);
// Rows of one slice: begun small and grown while a slice stays well below the 50 ms an ingest may wait for
// it.
constexpr std::size_t k_first_rows = 200, k_fewest_rows = 20, k_most_rows = 2000;
constexpr auto k_quick = std::chrono::milliseconds(15), k_slow = std::chrono::milliseconds(40);

}  // namespace

void Housekeeping::start() {
  if (deps_.by_hand || thread_.joinable()) return;
  thread_ = Thread("anchord-purge", [this] { loop(); });
}

void Housekeeping::stop() {
  {
    auto wishes = wishes_.lock();
    if (std::exchange(wishes->stop, true)) return;
  }
  told_.notify_all();
  if (thread_.joinable()) thread_.join();
  deps_.running.keep();
}

void Housekeeping::wake() {
  {
    auto wishes = wishes_.lock();
    wishes->round = true;
  }
  told_.notify_all();
}

void Housekeeping::loop() {
  for (;;) {
    (void)guarded("housekeeping", [this] { round(); });
    auto wishes = wishes_.lock();
    wishes.wait_for(told_, k_every, [](const Wishes& w) { return w.stop || w.round; });
    if (wishes->stop) return;
    wishes->round = false;
  }
}

/// False when stopping.
bool Housekeeping::pause(std::chrono::milliseconds time) {
  if (deps_.by_hand) return true;
  auto wishes = wishes_.lock();
  return !wishes.wait_for(told_, time, [](const Wishes& w) { return w.stop; });
}

void Housekeeping::round() {
  deps_.running.keep();
  const auto due = deps_.bin.empty_before(deps_.running.now_ns() - deps_.keep_deleted_ns);
  if (due && due.value() > 0) {
    deps_.events.add(
        EventLevel::info, "bin.emptied",
        std::to_string(due.value()) +
            " deleted missions have reached the end of their time in the bin and are being removed",
        {});
  }
  remove_marked();
  while (deps_.purge_answers && deps_.purge_answers()) {
    if (!pause(k_pause)) return;
  }
  // The longest last.
  deps_.cir_retention.round([this](std::chrono::milliseconds time) { return pause(time); });
}

void Housekeeping::remove_marked() {
  for (std::size_t rows = k_first_rows;;) {
    const auto begun = Steady::now();
    const auto removed = deps_.bin.remove_rows(rows);
    if (!removed || removed.value() == 0) return;  // storage in trouble: the next round tries again
    const auto took = Steady::now() - begun;
    if (took > k_slow) rows = std::max(k_fewest_rows, rows / 2);
    if (took < k_quick) rows = std::min(k_most_rows, rows * 2);
    if (!pause(k_pause)) return;
  }
}

}  // namespace anchord::api
