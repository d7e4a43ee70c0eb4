#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "api/kit/storage_status.hpp"
#include "core/base/enum_table.hpp"
#include "core/base/locked.hpp"
#include "core/base/steady.hpp"
#include "core/ports/cir_archive.hpp"

namespace anchord {
class AccessStore;
class Clock;
}  // namespace anchord

namespace anchord::api {

class EventLog;

/// The rule by which impulse responses of landed flights leave the database for files, and who asks for it by
/// hand. In small steps with pauses; while a flight is recorded, it works a tenth of the time. Thread-safe.
class CirRetention {
 public:
  struct Deps {
    CirArchive* archive{nullptr};           ///< null: there is none
    std::optional<std::int64_t> keep_days;  ///< after landing; absent: the rule is off
    EventLog& events;
    AccessStore& audit;
    const Clock& clock;
    const SteadyClock& steady;
    std::function<bool()> recording;
    std::function<StorageStatus()> storage;
  };
  /// Waits; false: stop.
  using Pause = std::function<bool(std::chrono::milliseconds)>;
  enum class To : std::uint8_t { file, database };

  explicit CirRetention(Deps deps) : deps_(std::move(deps)) {}

  /// Every flight that is due, the longest landed first.
  void round(const Pause& pause);
  /// Of one flight, now. errors: those of CirArchive; unsupported where there is no archive; storage_full
  /// below 1 GiB of free disk
  Result<ArchivedCirs> move(const MissionId& mission, To to, const Pause& pause);
  Result<std::vector<ArchivedCirs>> list() const;
  /// As /system shows it; null without an archive.
  nlohmann::ordered_json status() const;

 private:
  struct Totals {
    std::uint64_t flights{}, cirs{}, file_bytes{};
    std::string problem;  ///< of the last flight that could not be moved; empty: none
  };
  CirArchive::GoOn paced(const Pause& pause, std::string& why) const;
  Result<ArchivedCirs> move_paced(const MissionId& mission, To to, const Pause& pause);
  void count();
  void note(const ArchivedCirs& moved, To to, const char* by);
  void failed(const MissionId& mission, const Error& error);

  const Deps deps_;
  Locked<Totals> totals_;
};

inline constexpr auto k_cirs_to_words = enum_table<CirRetention::To>(
    {{"file", CirRetention::To::file}, {"database", CirRetention::To::database}});
nlohmann::ordered_json archived_json(const ArchivedCirs& one);

}  // namespace anchord::api
