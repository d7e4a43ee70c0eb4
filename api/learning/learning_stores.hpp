#pragma once

namespace anchord {
class CampaignStore;
class DatasetStore;
class LabelStore;
class ModelStore;
class TrainingRunStore;
}  // namespace anchord

namespace anchord::api {

/// The ports of learning, together.
struct LearningStores {
  CampaignStore& campaigns;
  LabelStore& labels;
  DatasetStore& datasets;
  TrainingRunStore& runs;
  ModelStore& models;
};

}  // namespace anchord::api
