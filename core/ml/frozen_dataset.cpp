#include "core/ml/frozen_dataset.hpp"

#include <algorithm>
#include <array>
#include <set>

#include "core/base/sha256.hpp"

namespace anchord::ml {
namespace {

constexpr std::array<std::string_view, 3> k_names{"none", "mean", "median"};

std::string digest_of(const FrozenDataset& set) {
  Sha256 sha;
  sha.add(std::string_view{set.data.digest()});
  sha.add(aggregation_name(set.aggregation));
  const std::set<std::uint32_t> places(set.data.group.begin(), set.data.group.end());
  for (const auto id : places) sha.add(place_name(set.data, id)), sha.add(std::string_view{"\0", 1});
  sha.add(std::string_view{"\1", 1});
  for (const auto& name : set.test_places) sha.add(name), sha.add(std::string_view{"\0", 1});
  return sha.hex();
}

}  // namespace

std::string_view aggregation_name(Aggregation aggregation) {
  return k_names.at(static_cast<std::size_t>(aggregation));
}

std::optional<Aggregation> aggregation_of(std::string_view name) {
  const auto* found = std::find(k_names.begin(), k_names.end(), name);
  if (found == k_names.end()) return std::nullopt;
  return static_cast<Aggregation>(found - k_names.begin());
}

bool FrozenDataset::in_test(std::size_t row) const {
  return std::find(test_places.begin(), test_places.end(), place_name(data, data.group[row])) !=
         test_places.end();
}

Result<FrozenDataset> freeze(const Dataset& data, const FreezeOptions& options) {
  const bool mean = options.aggregation == Aggregation::mean;
  Dataset rows = options.aggregation == Aggregation::none ? data : aggregate_placements(data, mean);
  BOOST_OUTCOME_TRY(const auto split,
                    split_places(rows, options.test_places, options.test_share, options.seed));
  const auto places = split_report(rows, split.train, split.test).test_place_names;
  return freeze_as(std::move(rows), options.aggregation, places);
}

Result<FrozenDataset> freeze_as(Dataset data, Aggregation was, const std::vector<std::string>& test_places) {
  FrozenDataset out;
  out.data = std::move(data);
  out.aggregation = was;
  BOOST_OUTCOME_TRY(const auto split, split_places(out.data, test_places, 0, 0));
  out.split = split_report(out.data, split.train, split.test);
  out.test_places = out.split.test_place_names;
  out.digest = digest_of(out);
  return out;
}

}  // namespace anchord::ml
