#pragma once

#include "core/nlos/features.hpp"
#include "core/ports/learning_store.hpp"
#include "core/types/range.hpp"

namespace anchord::api {

/// Features of what a radio told: the same for a range of a flight and a sample of a campaign, so that a
/// model meets in the air what it was trained on.
nlos::FeatureVector features_of(const Range& range);
nlos::FeatureVector features_of(const CampaignSample& sample, const GroundTruth& truth);

}  // namespace anchord::api
