#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/anchor.hpp"
#include "core/types/estimate.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"

namespace anchord {

/// What became of one row: the same identity with other content is a conflict, and the stored row stays.
enum class RowOutcome : std::uint8_t { accepted, duplicate, conflict, unknown_mission };

/// Measurements. append_* return after the commit is on the disk (fsynced); one call is one transaction, and
/// concurrent calls share one commit. Errors: storage_full, storage_unavailable, queue_full.
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
    std::size_t limit{100};
    std::string after;
    bool with_cir{false};
    bool descending{false};
  };
  template <class Row>
  struct Page {
    std::vector<Row> rows;
    std::string next;  ///< empty at the end
  };
  virtual Result<Page<Range>> ranges(const Filter& filter) = 0;
  virtual Result<Page<Fix>> fixes(const Filter& filter) = 0;
  virtual Result<std::uint64_t> count_ranges(const MissionId& mission) = 0;
};

class MissionStore {
 public:
  virtual ~MissionStore() = default;
  virtual Result<void> insert(const Mission& mission) = 0;
  virtual Result<void> update(const Mission& mission) = 0;
  virtual Result<Mission> mission(const MissionId& id) = 0;
  virtual Result<std::vector<Mission>> missions(std::size_t limit, const std::optional<MissionId>& after) = 0;
  virtual Result<void> remove(const MissionId& id) = 0;
};

/// Sites, anchors and their published positions. Updates name the version they change: conflict when it moved on.
class AnchorStore {
 public:
  virtual ~AnchorStore() = default;
  virtual Result<void> insert(const Site& site) = 0;
  virtual Result<void> update(const Site& site, std::uint64_t expected_version) = 0;
  virtual Result<Site> site(const SiteId& id) = 0;
  virtual Result<std::vector<Site>> sites(std::size_t limit, const std::optional<SiteId>& after) = 0;
  virtual Result<void> remove(const SiteId& id) = 0;

  virtual Result<Anchor> find_or_create(NetworkId network_id, UtcTime now) = 0;
  virtual Result<void> update(const Anchor& anchor, std::uint64_t expected_version) = 0;
  virtual Result<Anchor> anchor(const AnchorId& id) = 0;
  virtual Result<Anchor> anchor(NetworkId network_id) = 0;
  virtual Result<std::vector<Anchor>> anchors(std::size_t limit, const std::optional<AnchorId>& after) = 0;

  virtual Result<void> insert(const Calibration& calibration) = 0;
  virtual Result<Calibration> calibration(const CalibrationId& id) = 0;
  virtual Result<std::vector<Calibration>> calibrations(std::size_t limit,
                                                        const std::optional<CalibrationId>& after) = 0;
  virtual Result<Revision> publish(const CalibrationId& id, std::string_view by, std::string_view note,
                                   UtcTime now) = 0;
  virtual Result<std::vector<Revision>> revisions(std::size_t limit, std::uint64_t before) = 0;
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
  virtual Result<std::vector<Token>> tokens() = 0;
  virtual Result<void> revoke(const TokenId& id, UtcTime now) = 0;
};

/// Long work, visible and cancellable; survives a restart as `interrupted`.
enum class JobState : std::uint8_t { queued, running, succeeded, failed, canceled };
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
  virtual Result<std::vector<Job>> jobs(std::size_t limit, const std::optional<JobId>& after) = 0;
};

/// Answers kept for Idempotency-Key (24 h), and the append-only audit log with its hash chain.
struct StoredAnswer {
  std::string key, principal, request_sha256_hex, body;
  int status{};
  UtcTime created{};
};
struct AuditEntry {
  UtcTime time{};
  std::string who, what, from, result;
};

class AccessStore {
 public:
  virtual ~AccessStore() = default;
  virtual Result<std::optional<StoredAnswer>> answer(std::string_view principal, std::string_view key) = 0;
  virtual Result<void> keep_answer(const StoredAnswer& answer) = 0;
  virtual Result<void> append_audit(const AuditEntry& entry) = 0;
  virtual Result<std::vector<AuditEntry>> audit(std::size_t limit) = 0;
};

}  // namespace anchord
