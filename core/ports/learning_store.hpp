#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/ports/measurement_limits.hpp"
#include "core/types/campaign_record.hpp"
#include "core/types/document.hpp"

/// What learning keeps: campaigns, frozen data sets, training runs, models and who promoted them. The rules
/// of core/ports/measurement_store.hpp hold: writes return after the fsync, callable from any thread, lists
/// newest first.
namespace anchord {

struct CampaignRow {
  GroundTruth truth;
  CampaignSample sample;
};

/// Names are unique: conflict. Updates name the version they change: conflict when it moved on.
class CampaignStore {
 public:
  virtual ~CampaignStore() = default;
  virtual Result<void> insert(const CampaignRecord& campaign) = 0;
  virtual Result<void> update(const CampaignRecord& campaign, std::uint64_t expected_version) = 0;
  virtual Result<CampaignRecord> campaign(const CampaignId& id) = 0;
  virtual Result<CampaignRecord> campaign(std::string_view name) = 0;
  virtual Result<std::vector<CampaignRecord>> campaigns(std::size_t limit,
                                                        const std::optional<CampaignId>& after) = 0;
  virtual Result<void> remove(const CampaignId& id) = 0;

  struct Appended {
    std::size_t accepted{}, duplicates{};
  };
  enum class Untimed : std::uint8_t { known, fresh };
  /// All or none. A setting is known by its name; its first row's truth stands (conflict names a row that
  /// says otherwise). A row is a duplicate where its setting has a sample that agrees in everything the row
  /// tells (times to the microsecond), as often as it has one; two samples of one time and other content are
  /// two. Untimed::fresh: rows without a time are all new.
  virtual Result<Appended> append(const CampaignId& id, const std::vector<CampaignRow>& rows,
                                  Untimed untimed = Untimed::known) = 0;
  /// What append() would do now; nothing is stored.
  virtual Result<Appended> would_append(const CampaignId& id, const std::vector<CampaignRow>& rows,
                                        Untimed untimed = Untimed::known) = 0;

  struct Setting {
    GroundTruth truth;
    std::uint64_t n_samples{};
    double mean_range_m{};
    std::optional<double> sd_range_m{};
  };
  /// In order of first appearance.
  virtual Result<std::vector<Setting>> settings(const CampaignId& id) = 0;

  struct Filter {
    CampaignId campaign{};
    std::optional<std::string> setting, environment;
    MeasurementLimits limits;
    std::size_t every{1};  ///< about one in n of those that match, by a hash of the id
    std::size_t limit{100};
    std::int64_t after{0};  ///< sample id
    bool with_cir{false};
  };
  struct StoredSample {
    std::int64_t id{};
    GroundTruth truth;
    CampaignSample sample;
    bool has_cir{};
  };
  /// Ascending ids.
  virtual Result<std::vector<StoredSample>> samples(const Filter& filter) = 0;
  virtual Result<StoredSample> sample(const CampaignId& campaign, std::int64_t id) = 0;  ///< with its CIR
};

/// Ground truth of ranges of a flight, told afterwards.
class LabelStore {
 public:
  virtual ~LabelStore() = default;
  struct Filter {
    MissionId mission{};
    std::optional<NetworkId> anchor{}, tag{};
    std::optional<UtcTime> since{}, until{};  ///< until: not included
  };
  /// Overwrites what is given of the truth; how many ranges it was. not_found: no such mission.
  virtual Result<std::uint64_t> label(const Filter& filter, const RangeTruth& truth) = 0;
};

/// A frozen query: its rows never change, and its digest proves it.
struct DatasetRecord {
  DatasetId id{};
  std::string name;        ///< unique
  Document query, report;  ///< api/learning/freeze_rows
  std::string digest;
  std::uint64_t n_train{}, n_test{};
  UtcTime created{};
  std::string created_by;
};

class DatasetStore {
 public:
  virtual ~DatasetStore() = default;
  virtual Result<void> insert(const DatasetRecord& record, std::string_view csv) = 0;
  virtual Result<DatasetRecord> dataset(const DatasetId& id) = 0;
  virtual Result<DatasetRecord> dataset(std::string_view name) = 0;
  virtual Result<std::vector<DatasetRecord>> datasets(std::size_t limit,
                                                      const std::optional<DatasetId>& after) = 0;
  virtual Result<std::string> csv(const DatasetId& id) = 0;
  virtual Result<void> remove(const DatasetId& id) = 0;  ///< conflict when a training run used it
};

/// How a model came here and what it is. The artifact itself is apart, for it may be large.
struct StoredModel {
  ModelId id{};
  std::string task;  ///< nlos_id, los_bias, nlos_bias, bias
  std::string method;
  std::string sha256_hex;   ///< of the artifact
  Document manifest;        ///< of the artifact: features, scaler, data digest, seed, metrics
  std::string signature{};  ///< of this server's key over the artifact; empty: nobody vouches for it
  std::optional<TrainingRunId> run{};  ///< absent: uploaded
  UtcTime created{};
  std::string created_by;
};

struct TrainingRun {
  TrainingRunId id{};  ///< its job has the same
  DatasetId dataset{};
  std::string task;
  Document request;
  Document summary;  ///< empty until it has succeeded
  std::optional<ModelId> model{};
  UtcTime created{};
  std::string created_by;
};

class TrainingRunStore {
 public:
  virtual ~TrainingRunStore() = default;
  virtual Result<void> insert(const TrainingRun& run) = 0;
  virtual Result<TrainingRun> run(const TrainingRunId& id) = 0;
  /// Newest first; `task`: of this one alone.
  virtual Result<std::vector<TrainingRun>> runs(std::size_t limit, const std::optional<TrainingRunId>& after,
                                                const std::optional<std::string>& task = {}) = 0;
  /// Results, model and link between them in one transaction: there is a whole run or none.
  virtual Result<void> finish(const TrainingRunId& id, const Document& summary,
                              const std::map<std::string, std::string>& parts, const StoredModel& model,
                              std::string_view artifact) = 0;
  /// One part of the results ("folds", "grid", ...). not_found where the run has none of that name.
  virtual Result<std::string> part(const TrainingRunId& id, std::string_view name) = 0;
  /// The run and its results; its model stays. conflict: none.
  virtual Result<void> remove(const TrainingRunId& id) = 0;
};

struct Promotion {
  std::uint64_t number{};
  std::string task;
  std::optional<ModelId> model{};  ///< absent: none is active from here on
  std::string by, reason;
  UtcTime time{};
  bool rollback{};
  std::string signature{};  ///< to be kept with the model, in the same transaction; empty: as it is
};

/// Models of a task take turns: the newest promotion of a task says which is active.
class ModelStore {
 public:
  virtual ~ModelStore() = default;
  virtual Result<void> insert(const StoredModel& model, std::string_view artifact) = 0;
  virtual Result<StoredModel> model(const ModelId& id) = 0;
  virtual Result<std::vector<StoredModel>> models(std::size_t limit, const std::optional<ModelId>& after) = 0;
  virtual Result<std::string> artifact(const ModelId& id) = 0;
  virtual Result<void> sign(const ModelId& id, std::string_view signature) = 0;
  virtual Result<void> remove(const ModelId& id) = 0;  ///< conflict once it was promoted
  /// Its number is given back. conflict when the newest promotion of all tasks is no longer `decided_on` (0:
  /// none): the caller decided against another state.
  virtual Result<Promotion> promote(const Promotion& promotion,
                                    std::optional<std::uint64_t> decided_on = std::nullopt) = 0;
  /// The newest promotion of each task.
  virtual Result<std::vector<Promotion>> active() = 0;
  /// Newest first, of one task or all.
  virtual Result<std::vector<Promotion>> promotions(std::string_view task, std::size_t limit) = 0;
};

}  // namespace anchord
