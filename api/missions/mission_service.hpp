#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "api/admin/alarm_rules.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/steady.hpp"
#include "core/base/time.hpp"
#include "core/geo/track_segments.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/procedure/flight_priors.hpp"
#include "core/types/estimate.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"
#include "core/types/range_model.hpp"

namespace anchord {
class AnchorStore;
enum class RowOutcome : std::uint8_t;
class ExclusionStore;
class Executor;
class MeasurementStore;
class MissionStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class EventLog;
class Hub;
class LateWriter;
class MissionObserver;

/// Flights: their records and, for each, the one flight::LiveMission that follows the accepted measurements
/// and feeds the hub.
///
/// Thread-safe. Rows are queued per mission and worked off in order by one task at a time (a strand), so that
/// ingest never waits for a solve. A queue holds at most 100 000 rows; then the oldest leave the live path,
/// which is an event (the store has them).
class MissionService {
 public:
  static constexpr std::size_t k_max_queued_rows = 100'000;
  struct Deps {
    MissionStore& missions;
    MeasurementStore& measurements;
    SiteStore& sites;
    AnchorStore& anchors;
    Hub& hub;
    EventLog& events;
    const Clock& clock;
    const SteadyClock& steady;  ///< what silence is measured by
    Executor& live;             ///< rows to estimates, a strand for each mission
    Executor& joint;            ///< joint solutions in flight: seconds each
    LateWriter& late;
    ExclusionStore& exclusions;
    AccuracyGoal goal{};                       ///< of anchors that no flown plan has a target for
    std::function<std::string()> device_rows;  ///< more rows of topic `devices`, comma between them
    /// What the promoted models say of a range; nothing while none is promoted.
    std::function<std::optional<RangeModel>(const Range&)> predict;
    std::function<bool()> predict_needs_cir;
    std::function<bool()> models_promoted;
    bool site_outline{true};  ///< joint solutions take the site's outline as a prior: anchors are inside
    TrackLimits track{};      ///< what the positions of a flight are held against
    /// What turns and height searches of a mission's flight told, as kept with it.
    std::function<procedure::FlightPriors(const MissionId&)> kept_priors;
    /// What the plan that it was flown by wants of its anchors, likewise.
    std::function<PlanTargets(const MissionId&)> kept_targets;
  };
  /// Missions kept in memory although nothing of them is in the air: finished, or silent for k_silent_s. The
  /// others of these are evicted, least recently used first; the store has all of them.
  static constexpr std::size_t k_most_at_rest = 4;
  static constexpr double k_silent_s = 900;  ///< a change of battery is shorter
  explicit MissionService(Deps deps);
  ~MissionService();

  /// Before the first measurement; null ends it. The observer outlives the service or takes itself off.
  void observe(MissionObserver* observer);
  Result<Mission> mission(const MissionId& id);  ///< cached
  Result<void> create(const Mission& mission);
  /// conflict when it is finished already.
  Result<Mission> finish(const MissionId& id);
  /// What was declared of a finished mission is corrected: `edit` gets it as it is stored, one correction at
  /// a time, and may throw. Its estimates are computed anew. conflict while it records.
  Result<Mission> correct(const MissionId& id, const std::function<Mission(const Mission&)>& edit);
  /// It was deleted: nothing of it is followed, shown or cached any more.
  void forget(const MissionId& id);

  /// Before rows of this mission are stored: makes its live flight, and has what the store holds already read
  /// in by tasks of the pool, so that a restart in flight goes on where it was and no request waits for it.
  void prepare(const MissionId& id);
  /// After a restart: prepares the newest missions that still record, for their next rows are live at once.
  void resume();
  /// The promoted models want impulse responses: rows are accepted with them, and lose them once judged.
  bool wants_cir() const;
  /// An event in the record of every flight that records now.
  void note_in_flights(const std::string& code, const std::string& text);
  /// What a person took out of use of this mission changed: its live flight, where there is one, begins anew
  /// with what the store holds, less that.
  void exclusions_changed(const MissionId& id);
  /// Rows of one kind as they come, before they are stored: whatever is newer than all that came before of
  /// its tag and anchor (or rover) cannot be a repetition and goes to the live flight. The rest waits for the
  /// store's word. Never waits for the store.
  void arrived(std::span<const Range> ranges);
  void arrived(std::span<const Fix> fixes);
  /// The store's word on each: what it accepted and the live flight has not had goes there now.
  void accepted(std::span<const Range> ranges, std::span<const RowOutcome> outcomes);
  void accepted(std::span<const Fix> fixes, std::span<const RowOutcome> outcomes);

  /// What the turns and height searches of its flight told of its anchors: priors of every running estimate
  /// from now on. Never waits.
  void set_priors(const MissionId& id, procedure::FlightPriors priors);
  /// What the plan that is flown now wants of its anchors: what its estimates are held against from now on.
  /// Never waits.
  void set_targets(const MissionId& id, PlanTargets targets);

  struct LiveView {
    Mission mission;
    std::optional<Wgs84> origin;
    std::vector<Estimate> estimates;
  };
  /// Running estimates of one mission, or of all that are followed. Follows no mission: of one that is not
  /// followed they are computed from what the store holds (seconds for a long flight), and the answer alone
  /// is kept for a minute.
  std::vector<LiveView> live(const std::optional<MissionId>& id);
  /// What was estimated at some 240 moments of a flight, as the body {items, next_cursor} of running
  /// estimates; computed from the stored rows as they came (seconds for a long flight), one flight at a time.
  /// Null: the store failed, or the server stops.
  std::shared_ptr<const std::string> estimates_over_time(const MissionId& id);
  /// live() for whoever must not wait: nothing while its rows are worked off, and then what they gave as
  /// soon as they are.
  std::optional<LiveView> live_at_hand(const MissionId& id);

  /// Each 500 ms: mission.state of what moved, devices once a second; a joint solution is begun where enough
  /// ranges came since the last (at most a quarter of one core).
  void tick();
  /// Flights that were finished since the start.
  std::uint64_t finished() const;
  /// How each recording flight stands, for its alarms; to be called once a second (FlightWatch).
  std::vector<FlightPulse> pulses();
  /// Rows that wait to be worked off, over all missions.
  std::size_t queued() const;
  std::size_t followed() const;   ///< missions in memory
  std::uint64_t evicted() const;  ///< missions that left it since the start
  bool recording() const;         ///< a mission got measurements in the last 5 s
  /// Refuses new work and waits until no task is running.
  void stop();

 private:
  struct Flight;
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace anchord::api
