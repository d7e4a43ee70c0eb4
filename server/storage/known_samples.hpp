#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/types/campaign_record.hpp"
#include "server/storage/sql.hpp"

namespace anchord::sql {

/// What one setting of a campaign has already of the samples that an import brings, known by their content: a
/// stored one is the same when it agrees in everything the new one tells (an export tells less than was
/// sent). Times agree to the microsecond, as exports have them.
class KnownSamples {
 public:
  /// Reads the stored samples of the times of `rows`, and those without a time where some of `rows` have
  /// none.
  KnownSamples(Connection& connection, std::int64_t setting_key,
               const std::vector<const CampaignSample*>& rows);

  /// Whether it is stored; each stored sample is the answer once, for a still link repeats itself.
  bool take(const CampaignSample& row);
  /// Of a new sample: two of one time differ in it.
  std::optional<std::uint64_t> free_seq(const CampaignSample& row);

 private:
  struct Stored {
    std::int64_t id{};
    CampaignSample sample;
    bool has_cir{};
  };
  bool agrees(const Stored& stored, const CampaignSample& row);
  void read(const std::string& text, std::int64_t setting_key, const std::vector<std::int64_t>& bounds);

  Connection& connection_;
  std::unordered_map<std::uint64_t, std::vector<Stored>> stored_;  ///< by microsecond, else by range
  std::map<std::int64_t, std::set<std::int64_t>> seqs_;            ///< of each time, none as -1
};

}  // namespace anchord::sql
