#pragma once

#include <string>
#include <vector>

#include "core/ml/model.hpp"

/// What `anchord models` prints.
namespace anchord::api {

struct NamedModel {
  std::string path{};
  ml::Model model{};
};

std::string models_json(const std::vector<NamedModel>& models);
std::string models_text(const std::vector<NamedModel>& models);  ///< one line a model
std::string model_text(const NamedModel& model);                 ///< its whole manifest

}  // namespace anchord::api
