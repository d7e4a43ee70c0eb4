#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/http/problem.hpp"
#include "api/learning/dataset_table.hpp"
#include "core/ports/learning_store.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {

enum class Aggregation : std::uint8_t {
  none,
  mean,    ///< of each feature over the measurements of a setting (6.2.1)
  median,  ///< the same, and with 3 measurements or more their spreads as features
};

/// What a data set is made of.
struct DatasetQuery {
  std::string name;
  std::vector<CampaignId> campaigns;
  std::vector<MissionId> missions;        ///< their labelled ranges
  std::vector<std::string> environments;  ///< empty: all
  Aggregation aggregation{Aggregation::mean};
  bool filter_faults{true};
  Place split_by{Place::environment};
  std::vector<std::string> test;  ///< names of places
  double test_share{0};           ///< or this share of the places, drawn by the seed
  std::uint64_t seed{1};
  std::string json;  ///< as accepted
};

/// Reads the body of POST /datasets; campaigns may be named. What is wrong goes to `errors`.
DatasetQuery read_dataset_query(const nlohmann::json& body, CampaignStore& campaigns, MissionStore& missions,
                                std::vector<FieldError>& errors);

struct FrozenDataset {
  DatasetTable table;
  std::string report_json;
  std::size_t n_train{}, n_test{};
};

/// Reads everything the query names, drops faults, aggregates, splits. errors: too_few_observations (no row),
/// not_found (a test place that is not there)
Result<FrozenDataset> freeze(const DatasetQuery& query, CampaignStore& campaigns,
                             MeasurementStore& measurements, MissionStore& missions);

/// The report of a table whose rows say already which part they are in: sizes, and what both parts share.
std::string split_report_json(const DatasetTable& table, Place split_by,
                              const std::map<std::string, std::size_t>& dropped);

}  // namespace anchord::api
