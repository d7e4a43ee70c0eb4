#include "api/admin/cir_retention.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "core/base/time.hpp"
#include "core/ports/access_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;
using std::chrono::milliseconds;

/// Twice what lets a new flight start (docs/durability.md): files must not be what ends one.
constexpr std::uint64_t k_least_free_bytes = std::uint64_t{1} << 30;
constexpr auto k_shortest_pause = milliseconds(40), k_longest_pause = milliseconds(2000);
/// Of the time that a step took: while a flight is recorded, and while none is.
constexpr double k_pause_in_flight = 9, k_pause = 1;
constexpr std::size_t k_flights_a_round = 20;
constexpr std::int64_t k_day_ns = 86'400LL * 1'000'000'000;

Error no_archive() {
  return make_error(Errc::unsupported, "this server keeps no impulse responses in files");
}

}  // namespace

nlohmann::ordered_json archived_json(const ArchivedCirs& one) {
  return {{"mission", to_string(one.mission)},
          {"name", one.mission_name},
          {"file", one.file},
          {"written_to", one.place},
          {"here", one.here},
          {"sha256", one.sha256_hex},
          {"bytes", one.file_bytes},
          {"n_cirs", one.n_cirs},
          {"n_moved", one.n_moved},
          {"archived_at", to_rfc3339(one.archived)},
          {"held", one.held}};
}

void CirRetention::round(const Pause& pause) {
  if (deps_.archive == nullptr) return;
  count();
  if (!deps_.keep_days) return;
  const UtcTime before{deps_.clock.now().ns - *deps_.keep_days * k_day_ns};
  const auto due = deps_.archive->due(before, k_flights_a_round);
  if (!due) return;  // storage in trouble: the next round tries again
  for (const MissionId& mission : due.value()) {
    const auto moved = move_paced(mission, To::file, pause);
    if (!moved && moved.error().code == Errc::canceled) return;
    if (!moved) {
      failed(mission, moved.error());
      continue;
    }
    if (moved.value().n_cirs > 0) note(moved.value(), To::file, "retention rule");
  }
}

Result<ArchivedCirs> CirRetention::move(const MissionId& mission, To to, const Pause& pause) {
  if (deps_.archive == nullptr) return no_archive();
  BOOST_OUTCOME_TRY(auto moved, move_paced(mission, to, pause));
  if (moved.n_cirs == 0)
    return make_error(Errc::not_found, "mission " + to_string(mission) + " has no impulse responses");
  note(moved, to, nullptr);
  return moved;
}

Result<std::vector<ArchivedCirs>> CirRetention::list() const {
  if (deps_.archive == nullptr) return std::vector<ArchivedCirs>{};
  return deps_.archive->list();
}

Ordered CirRetention::status() const {
  if (deps_.archive == nullptr) return nullptr;
  const Totals totals = totals_.copy();
  return {{"keep_days", deps_.keep_days ? Ordered(*deps_.keep_days) : Ordered(nullptr)},
          {"flights", totals.flights},
          {"n_moved", totals.cirs},
          {"file_bytes", totals.file_bytes},
          {"problem", totals.problem.empty() ? Ordered(nullptr) : Ordered(totals.problem)}};
}

/// `why`: what stopped it, where that is not the caller.
CirArchive::GoOn CirRetention::paced(const Pause& pause, std::string& why) const {
  return [this, &pause, &why, last = deps_.steady.now()]() mutable {
    if (const auto free = deps_.storage().disk_free_bytes; free > 0 && free < k_least_free_bytes) {
      why = std::to_string(free >> 20) + " MiB free on the disk, " +
            std::to_string(k_least_free_bytes >> 20) + " needed: make room first";
      return false;
    }
    const double share = deps_.recording() ? k_pause_in_flight : k_pause;
    const double pause_ms = seconds_between(last, deps_.steady.now()) * 1000 * share;
    const bool on = pause(
        std::clamp(milliseconds(static_cast<std::int64_t>(pause_ms)), k_shortest_pause, k_longest_pause));
    last = deps_.steady.now();
    return on;
  };
}

Result<ArchivedCirs> CirRetention::move_paced(const MissionId& mission, To to, const Pause& pause) {
  std::string why;
  const auto go_on = paced(pause, why);
  auto moved = to == To::file ? deps_.archive->archive(mission, deps_.clock.now(), go_on)
                              : deps_.archive->bring_back(mission, go_on);
  count();
  if (!moved && !why.empty()) return make_error(Errc::storage_full, why);
  return moved;
}

void CirRetention::count() {
  const auto all = deps_.archive->list();
  if (!all) return;
  auto totals = totals_.lock();
  totals->flights = totals->cirs = totals->file_bytes = 0;
  for (const auto& one : all.value()) {
    ++totals->flights;
    totals->cirs += one.n_moved;
    totals->file_bytes += one.file_bytes;
  }
}

/// `by`: null where the request is audited as the others are.
void CirRetention::note(const ArchivedCirs& moved, To to, const char* by) {
  {
    auto totals = totals_.lock();
    totals->problem.clear();
  }
  const std::string what = std::to_string(moved.n_cirs) + " impulse responses of mission " +
                           to_string(moved.mission) +
                           (to == To::file ? " are in file " + moved.file : " are in the database again");
  deps_.events.add(EventLevel::info, to == To::file ? "cir.archived" : "cir.restored", what);
  if (by == nullptr) return;
  const auto audited = deps_.audit.append_audit(
      {deps_.clock.now(), by, "cir.archive " + to_string(moved.mission), "local", "ok"});
  if (!audited) deps_.events.add(EventLevel::warning, "cir.archived", audited.error().message);
}

void CirRetention::failed(const MissionId& mission, const Error& error) {
  std::string text = "the impulse responses of mission " + to_string(mission) +
                     " could not be moved into a file, and stay in the database: " + error.message;
  {
    auto totals = totals_.lock();
    if (totals->problem == text) return;  // each minute the same
    totals->problem = text;
  }
  deps_.events.add(EventLevel::warning, "cir.archive_failed", std::move(text));
}

}  // namespace anchord::api
