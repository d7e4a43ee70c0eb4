#pragma once

#include <string>

#include "core/ml/model.hpp"
#include "core/nlos/features.hpp"
#include "core/ports/learning_store.hpp"
#include "core/types/range.hpp"

namespace anchord::api {

/// Features of what a radio told: the same for a range of a flight and a sample of a campaign, so that a
/// model meets in the air what it was trained on.
/// whole_record  with the features that need one, which no model that judges ranges of a flight may ask for
nlos::FeatureVector features_of(const Range& range, bool whole_record = true);
nlos::FeatureVector features_of(const CampaignSample& sample, const GroundTruth& truth);

/// Features the model asks for that no range of a flight has, by name and with what would give them; empty
/// where it can judge ranges.
std::string lacking_in_flight(const ml::Model& model);

}  // namespace anchord::api
