#include "api/learning/training_work.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/learning/model_artifact.hpp"
#include "api/learning/training_parts.hpp"
#include "api/learning/training_request.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

Result<std::string> train_work(const Json& message, const std::stop_token& stop,
                               const WorkProgressSink& progress) {
  std::vector<FieldError> errors;
  const auto request = read_training_request(message.at("request"), errors);
  if (!errors.empty())
    return make_error(Errc::invalid_argument, errors.front().pointer + ": " + errors.front().detail);
  const auto& csv = message.at("csv").get_ref<const std::string&>();
  BOOST_OUTCOME_TRY(const auto table, DatasetTable::parse(csv));
  auto spec = request.spec;
  auto wish = wish_of(spec.task, table);
  wish.features = spec.features;
  wish.group_by = request.group_by;
  BOOST_OUTCOME_TRY(const auto rows, learning_rows(table, wish));
  spec.held_out = rows.held_out;
  BOOST_OUTCOME_TRY(auto outcome, ml::train(rows.data, spec, stop, [&](const ml::TrainingProgress& p) {
                      if (progress) progress({p.stage, p.stage_index, p.stage_count, p.fraction, p.detail});
                    }));
  auto& info = outcome.model.info;
  info.feature_set = table.feature_set;
  info.group_by = place_word(request.group_by);
  info.code_version = message.value("code_version", std::string());
  info.data_digest = dataset_digest(csv);
  info.not_for_live = not_for_live(table);
  auto parts = training_parts(outcome, table, rows);
  BOOST_OUTCOME_TRY(auto artifact, checked_model_artifact(outcome.model));
  nlohmann::ordered_json out{{"artifact", std::move(artifact)}};
  out["summary"] = std::move(parts.at("summary"));
  parts.erase("summary");
  out["parts"] = std::move(parts);
  return to_wire(out);
}

}  // namespace

Result<std::string> do_training_work(std::string_view message, const std::stop_token& stop,
                                     const WorkProgressSink& progress) {
  const auto json = Json::parse(message, nullptr, false);
  if (!json.is_object()) return make_error(Errc::bad_frame, "the message is not a JSON object");
  try {
    if (json.value("kind", std::string()) == "training") return train_work(json, stop, progress);
  } catch (const Json::exception& fault) {
    return make_error(Errc::bad_frame, fault.what());
  }
  return make_error(Errc::bad_frame, "unknown kind of work");
}

}  // namespace anchord::api
