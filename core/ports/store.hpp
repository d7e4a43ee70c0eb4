#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/ports/measurement_limits.hpp"
#include "core/types/anchor.hpp"
#include "core/types/estimate.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"

namespace anchord {

/// What became of one row: the same identity with other content is a conflict, and the stored row stays.
enum class RowOutcome : std::uint8_t { accepted, duplicate, conflict, unknown_mission };

/// A radio heard in a mission, kept up to date by the appends.
struct DeviceSeen {
  enum class Kind : std::uint8_t { tag, anchor };
  NetworkId network_id{};
  Kind kind{Kind::anchor};
  MissionId mission{};
  UtcTime first_seen{}, last_seen{};  ///< measured times
  std::uint64_t n_ranges{};
};
inline constexpr auto k_radio_words =
    enum_table<DeviceSeen::Kind>({{"tag", DeviceSeen::Kind::tag}, {"anchor", DeviceSeen::Kind::anchor}});

/// Measurements. append_* return after the commit is on the disk (fsynced); concurrent calls share one
/// commit. Outcomes stand in the order of the rows. With `atomic`, one row that is a conflict or of an
/// unknown mission stores none of the call (the outcomes tell which; rows that would have been stored say
/// `accepted`, so look for a bad one). The same identity and content (arrival time aside) is a duplicate.
/// Callable from any thread; blocks. Errors of every port: storage_full, storage_unavailable, queue_full;
/// not_found and conflict as named.
class MeasurementStore {
 public:
  virtual ~MeasurementStore() = default;
  virtual Result<std::vector<RowOutcome>> append_ranges(std::vector<Range> rows, bool atomic) = 0;
  virtual Result<std::vector<RowOutcome>> append_fixes(std::vector<Fix> rows, bool atomic) = 0;

  /// Keyset page in order of (time, row id). `after` is the opaque cursor of the last page, empty at first.
  struct Filter {
    std::optional<MissionId> mission;
    std::optional<NetworkId> anchor, tag;
    std::optional<UtcTime> since, until;
    MeasurementLimits limits;  ///< of ranges
    std::optional<FixClass>
        fix;  ///< of ranges: of the newest position at most 2 s before it; none: there is no such
    std::size_t every{1};  ///< about one in n of those that match, by a hash of the id: for a picture of many
    std::size_t limit{100};
    std::string after;
    bool with_cir{false};
    bool descending{false};
  };
  template <class Row>
  struct Page {
    std::vector<Row> rows;
    std::vector<std::int64_t> ids;  ///< row ids, parallel to rows: the {id} of /ranges/{id}
    std::string next;               ///< empty at the end
  };
  /// Errors of a page or count: not_found where filter.mission is not there (any more): who reads page by
  /// page never takes the beginning of a flight deleted meanwhile for the whole.
  virtual Result<Page<Range>> ranges(const Filter& filter) = 0;
  virtual Result<Page<Fix>> fixes(const Filter& filter) = 0;
  virtual Result<Range> range(std::int64_t id) = 0;  ///< with CIR and truth
  virtual Result<std::uint64_t> count_ranges(const MissionId& mission) = 0;
  /// All that match, whatever `every`, `limit` and `after` say. Looks at each row of the mission.
  virtual Result<std::uint64_t> count_ranges(const Filter& filter) = 0;
  virtual Result<std::uint64_t> count_fixes(const MissionId& mission) = 0;
  /// All radios of one mission, or of all (one row per mission and device), newest first.
  virtual Result<std::vector<DeviceSeen>> devices(const std::optional<MissionId>& mission) = 0;
};

/// Flights, newest first in lists (`after`: the last id of the page before): in order of insertion, whatever
/// the clock said. insert answers storage_full already when little space is left, so that a flight that runs
/// can finish. Deleting is MissionBin's (core/ports/mission_bin.hpp).
class MissionStore {
 public:
  virtual ~MissionStore() = default;
  virtual Result<void> insert(const Mission& mission) = 0;
  virtual Result<void> update(const Mission& mission) = 0;
  /// The mission as it is then; conflict when it was finished already.
  virtual Result<Mission> finish(const MissionId& id, UtcTime now) = 0;
  virtual Result<Mission> mission(const MissionId& id) = 0;
  virtual Result<std::vector<Mission>> missions(std::size_t limit, const std::optional<MissionId>& after) = 0;
};

/// Position of one anchor in a published revision.
struct PublishedPosition {
  std::uint64_t since_revision{};  ///< the revision that set it; later ones carried it on
  CalibrationId calibration{};
  UtcTime published{};
  TrackFrame frame{TrackFrame::wgs84};
  std::optional<Wgs84> origin{};
  Estimate estimate{};
  std::optional<Override> overridden{};  ///< published in spite of a gate
};

/// Sites, anchors and their published positions. Updates name the version they change: conflict when it moved
/// on; the stored version becomes expected_version + 1. Lists are in id order, calibrations and revisions
/// newest first.
class AnchorStore {
 public:
  virtual ~AnchorStore() = default;
  virtual Result<void> insert(const Site& site) = 0;
  virtual Result<void> update(const Site& site, std::uint64_t expected_version) = 0;
  virtual Result<Site> site(const SiteId& id) = 0;
  virtual Result<std::vector<Site>> sites(std::size_t limit, const std::optional<SiteId>& after) = 0;
  virtual Result<void> remove(const SiteId& id, std::uint64_t expected_version) = 0;

  virtual Result<Anchor> find_or_create(NetworkId network_id, UtcTime now) = 0;
  virtual Result<void> update(const Anchor& anchor, std::uint64_t expected_version) = 0;
  virtual Result<Anchor> anchor(const AnchorId& id) = 0;
  virtual Result<Anchor> anchor(NetworkId network_id) = 0;
  virtual Result<std::vector<Anchor>> anchors(std::size_t limit, const std::optional<AnchorId>& after) = 0;

  virtual Result<void> insert(const Calibration& calibration) = 0;
  virtual Result<Calibration> calibration(const CalibrationId& id) = 0;
  virtual Result<std::vector<Calibration>> calibrations(std::size_t limit,
                                                        const std::optional<CalibrationId>& after) = 0;
  /// What insert was given as evidence_json; empty when there was none.
  virtual Result<std::string> evidence(const CalibrationId& id) = 0;
  virtual Result<void> remove(const CalibrationId& id) = 0;  ///< conflict when a revision uses it
  /// A new revision: the named anchors (each with a position in the calibration, else invalid_argument) take
  /// their position from it, all others keep that of the revision before. Which verdicts may be published is
  /// not decided here; `overrides` (of named anchors) are kept with the revision. conflict when every named
  /// anchor stands at its position of this calibration already, or when the newest revision is no longer
  /// `judged_on` (0: none), against which the caller decided.
  virtual Result<Revision> publish(const CalibrationId& id, const std::vector<NetworkId>& anchors,
                                   std::string_view by, std::string_view note, UtcTime now,
                                   const std::vector<Override>& overrides = {},
                                   std::optional<std::uint64_t> judged_on = std::nullopt) = 0;
  /// before: 0 for the newest page.
  virtual Result<std::vector<Revision>> revisions(std::size_t limit, std::uint64_t before) = 0;
  /// All positions of a revision, of the newest when absent (empty when nothing was ever published).
  virtual Result<std::vector<PublishedPosition>> published(std::optional<std::uint64_t> revision) = 0;
  /// Every position ever published of one anchor, newest first.
  virtual Result<std::vector<PublishedPosition>> history(NetworkId network_id) = 0;
};

/// Access tokens: only the hash of the secret is stored.
struct Token {
  TokenId id{};
  std::string name;
  std::string secret_sha256_hex;
  std::vector<std::string> roles;
  UtcTime created{};
  std::optional<UtcTime> expires{}, revoked{}, last_used{};
};

class TokenStore {
 public:
  virtual ~TokenStore() = default;
  virtual Result<void> insert(const Token& token) = 0;
  virtual Result<Token> token(const TokenId& id) = 0;
  virtual Result<Token> token_by_secret(std::string_view secret_sha256_hex) = 0;
  virtual Result<std::vector<Token>> tokens() = 0;
  virtual Result<void> touch(const TokenId& id,
                             UtcTime now) = 0;  ///< last used; call it at most once a minute
  virtual Result<void> revoke(const TokenId& id, UtcTime now) = 0;
};

/// Long work, visible and cancellable. At start the server calls fail_unfinished, for nothing runs then.
enum class JobState : std::uint8_t { queued, running, succeeded, failed, canceled };
inline constexpr auto k_job_state_words = enum_table<JobState>({{"queued", JobState::queued},
                                                                {"running", JobState::running},
                                                                {"succeeded", JobState::succeeded},
                                                                {"failed", JobState::failed},
                                                                {"canceled", JobState::canceled}});
struct Job {
  JobId id{};
  std::string kind;
  JobState state{JobState::queued};
  double fraction{0};
  std::string stage, detail, result_href, problem_json, request_json;
  UtcTime created{};
  std::optional<UtcTime> started{}, finished{};
};

class JobStore {
 public:
  virtual ~JobStore() = default;
  virtual Result<void> insert(const Job& job) = 0;
  virtual Result<void> update(const Job& job) = 0;
  virtual Result<Job> job(const JobId& id) = 0;
  virtual Result<std::vector<Job>> jobs(std::size_t limit,
                                        const std::optional<JobId>& after) = 0;  ///< newest first
  /// Queued and running jobs become failed with this problem; says how many.
  virtual Result<std::size_t> fail_unfinished(UtcTime now, std::string_view problem_json) = 0;
};

/// Answers kept for Idempotency-Key, and the append-only audit log with its hash chain.
struct StoredAnswer {
  std::string key, principal, request_sha256_hex, body;
  std::string location, etag;  ///< its headers of these names; empty: it had none
  int status{};
  std::int64_t created_ran_ns{};  ///< running time of the service (ServiceStore): no clock step ends it early
};
/// What the kept answers of one principal take.
struct AnswerUse {
  std::size_t count{};
  std::uint64_t bytes{};  ///< of bodies
};
struct AuditEntry {
  UtcTime time{};
  std::string who, what, from, result;
};

class AccessStore {
 public:
  virtual ~AccessStore() = default;
  virtual Result<std::optional<StoredAnswer>> answer(std::string_view principal, std::string_view key) = 0;
  /// Takes the place of one that was kept before `expired_ran_ns`; conflict when the principal has a younger
  /// one under this key.
  virtual Result<void> keep_answer(const StoredAnswer& answer, std::int64_t expired_ran_ns) = 0;
  virtual Result<AnswerUse> answer_use(std::string_view principal) = 0;
  /// The oldest first, at most so many in one short transaction; says how many went.
  virtual Result<std::size_t> drop_answers_before(std::int64_t ran_ns, std::size_t most) = 0;
  virtual Result<std::size_t> drop_oldest_answers(std::string_view principal, std::size_t most) = 0;
  virtual Result<void> append_audit(const AuditEntry& entry) = 0;
  virtual Result<std::vector<AuditEntry>> audit(std::size_t limit) = 0;  ///< newest first
  /// conflict, naming the entry, when the hash chain is broken.
  virtual Result<void> verify_audit() = 0;
};

}  // namespace anchord
