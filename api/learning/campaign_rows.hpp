#pragma once

#include <string>
#include <vector>

#include "api/kit/message.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord::api {

/// The body of POST /campaigns/{id}/samples, read whole: CSV, NDJSON or the simple .txt of one measurement a
/// line. Query parameters name the truth of rows that tell none.
struct CampaignRows {
  std::vector<CampaignRow> rows;
  /// A single row without a time is always new: a still link measures the same number twice.
  CampaignStore::Untimed untimed{CampaignStore::Untimed::known};
  std::string report_json;  ///< what was read, what was dropped and why, line by line for the first 100
};
/// Throws ProblemException: 415, 422.
CampaignRows read_campaign_rows(const Request& request);

}  // namespace anchord::api
