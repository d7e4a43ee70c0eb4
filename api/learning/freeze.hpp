#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "api/learning/freeze_rows.hpp"
#include "core/ports/learning_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord {
class ExclusionStore;
}  // namespace anchord

namespace anchord::api {

/// What a data set is made of.
struct DatasetQuery {
  std::string name;
  std::vector<CampaignId> campaigns;
  std::vector<MissionId> missions;        ///< their labelled ranges
  std::vector<std::string> environments;  ///< empty: all
  FreezeOptions how;
  std::string json;  ///< as accepted
};

/// Reads the body of POST /datasets; campaigns may be named. What is wrong goes to `errors`.
DatasetQuery read_dataset_query(const nlohmann::json& body, CampaignStore& campaigns, MissionStore& missions,
                                std::vector<FieldError>& errors);

/// Reads everything the query names, less what a person took out of use, drops faults, aggregates, splits.
/// errors: too_few_observations (no row), not_found (a test place that is not there)
Result<FrozenDataset> freeze(const DatasetQuery& query, CampaignStore& campaigns,
                             MeasurementStore& measurements, MissionStore& missions,
                             ExclusionStore& exclusions);

}  // namespace anchord::api
