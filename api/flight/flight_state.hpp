#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>

#include "api/flight/flight_service.hpp"
#include "api/flight/interval_histogram.hpp"
#include "api/kit/storage_status.hpp"
#include "api/missions/mission_service.hpp"
#include "api/planning/plan_json.hpp"
#include "core/base/guard.hpp"
#include "core/flight/operations.hpp"

namespace anchord::api {

/// The shell round flight::Operations: thread, clocks, lock; what is shown (flight_show.cpp) and kept
/// (flight_kept.cpp).
struct FlightService::State {
  explicit State(Deps d) : deps(std::move(d)), operations(deps.drone, !deps.now_s) {}

  flight::Now now() const;
  void tell_events();
  /// Under the lock: whether what is due apart has to be handed to the executor (by the caller, without it).
  bool apart_is_due();
  /// All that is due, with the lock given away meanwhile.
  void work_apart();
  bool piece_apart(std::unique_lock<std::mutex>& lock);
  void decide(std::unique_lock<std::mutex>& lock);
  flight::Groundwork groundwork(const Plan* plan);
  void recover();
  /// The document to store, when the machine moved since the last call; empty text: forget it.
  bool to_keep(std::string& text);
  void keep(const MissionId& mission, std::string document) const;
  nlohmann::ordered_json procedure(const flight::ActiveFlight& f) const;
  void publish();
  void show_grid(std::unique_lock<std::mutex>& lock);
  void show_profiles(std::unique_lock<std::mutex>& lock);

  Deps deps;
  std::mutex mutex;
  std::condition_variable wake, changed, idle;
  Thread thread;
  bool stopping{false};
  flight::Operations operations;

  /// What a round asks for that takes long with hundreds of anchors: done beside it, never in it.
  struct Apart {
    std::optional<flight::Operations::PointTask> point;
    bool grid{false}, profiles{false};
    bool handed_over{false};  ///< to the executor, and not done
    bool any() const { return point || grid || profiles; }
    void drop() {
      point.reset();
      grid = profiles = false;
    }
  } apart;

  IntervalHistogram checks_apart;  ///< of safety, while something flies

  /// What of the present flight was kept, shown and told; each flight begins anew.
  struct Last {
    std::uint64_t flight{0}, kept{~0ULL}, shown{~0ULL}, clues_passed{0};
    double shown_s{-10}, profiles_s{-10};
  } last;

  struct Checked {
    PlanId plan{};
    std::uint64_t revision{};
    std::shared_ptr<const planning::PlanCheck> check;
  };
  std::mutex checks_mutex;
  std::deque<Checked> checks;  ///< newest last, at most 64: pages ask for the same one every second
};

}  // namespace anchord::api
