#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "api/admin/alarm_rules.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/localize/contradiction.hpp"
#include "core/types/anchor.hpp"

namespace anchord {
class AnchorStore;
class CalibrationStore;
class MissionStore;
class RevisionStore;
}  // namespace anchord

namespace anchord::api {

class EventLog;

/// A published anchor that a later flight found elsewhere, with the evidence.
struct ContradictedAnchor {
  Contradiction what;
  CalibrationId calibration{};  ///< whose answer contradicts
  std::vector<MissionId> missions;
  UtcTime measured{};  ///< newest range of that answer
  std::string text;    ///< for people: how far, how sure, exchanged with which
};
nlohmann::ordered_json contradiction_json(const ContradictedAnchor& anchor);

/// Holds the newest published revision against every calibration of a later flight. Of several the one with
/// the newest ranges decides, so that a flight which agrees again ends it. What is newly contradicted is an
/// event; what stands is an alarm until it is published anew or retired. Thread-safe.
class ContradictionWatch {
 public:
  struct Deps {
    AnchorStore& anchors;
    CalibrationStore& calibrations;
    RevisionStore& revisions;
    MissionStore& missions;
    EventLog& events;
  };
  using Standing = std::map<NetworkId, ContradictedAnchor>;

  explicit ContradictionWatch(Deps deps) : deps_(deps) {}
  /// A calibration was stored or removed, a revision published, an anchor changed: the next reader compares
  /// anew.
  void changed();
  /// Up to date as far as the store can be read; reads it only after a change. What cannot be read leaves the
  /// last answer, and the next call tries again.
  std::shared_ptr<const Standing> standing();
  /// The change that the last answer is of; none while a newer one waits for its reader.
  std::optional<std::uint64_t> settled() const;
  /// The last answer, without reading: at most one alarm, which names them all.
  std::vector<AlarmCondition> alarms() const;

 private:
  Result<Standing> compare();
  struct Newest {
    std::uint64_t change{1}, compared{0};
    bool known{false};  ///< once compared: what was contradicted before the start is no news
    std::shared_ptr<const Standing> standing{std::make_shared<Standing>()};
  };

  Deps deps_;
  std::mutex comparing_;  ///< one comparison at a time, while the store is read; taken before newest_
  Locked<Newest> newest_;
};

}  // namespace anchord::api
