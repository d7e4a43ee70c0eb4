#include "api/learning/model_report.hpp"

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

std::string format(const char* pattern, auto... values) {
  std::array<char, 512> text{};
  std::snprintf(text.data(), text.size(), pattern, values...);
  return text.data();
}

std::string metric(const ml::ModelInfo& info, const char* name) {
  for (const auto& [key, value] : info.metrics)
    if (key == name) return format("%.3f", value);
  return "-";
}

}  // namespace

std::string models_json(const std::vector<NamedModel>& models) {
  auto out = nlohmann::ordered_json::array();
  for (const auto& [path, model] : models) {
    const auto& i = model.info;
    nlohmann::ordered_json metrics = nlohmann::ordered_json::object();
    for (const auto& [name, value] : i.metrics) metrics[name] = value;
    out.push_back({{"path", path},
                   {"task", ml::task_name(i.task)},
                   {"method", i.method},
                   {"feature_set", i.feature_set},
                   {"features", i.features},
                   {"digest", i.data_digest},
                   {"rows", i.rows},
                   {"placements", i.placements},
                   {"places", i.groups},
                   {"group_by", i.group_by},
                   {"folds", i.folds},
                   {"seed", i.seed},
                   {"code_version", i.code_version},
                   {"why", i.why},
                   {"metrics", metrics}});
    if (!i.not_for_live.empty()) out.back()["not_for_live"] = i.not_for_live;
    if (model.classifier) out.back()["threshold"] = model.classifier->threshold;
  }
  return to_wire(nlohmann::ordered_json{{"models", out}}, 2) + "\n";
}

std::string models_text(const std::vector<NamedModel>& models) {
  std::string out = format("%-32s %-10s %8s %7s %8s %8s  %s\n", "model", "task", "accuracy", "FPR", "MAE raw",
                           "MAE", "method");
  for (const auto& [path, model] : models)
    out += format("%-32s %-10s %8s %7s %8s %8s  %s\n", path.c_str(),
                  std::string{ml::task_name(model.info.task)}.c_str(), metric(model.info, "accuracy").c_str(),
                  metric(model.info, "fpr").c_str(), metric(model.info, "mae_raw_m").c_str(),
                  metric(model.info, "mae_m").c_str(), model.info.method.c_str());
  return out;
}

std::string model_text(const NamedModel& one) {
  const auto& i = one.model.info;
  std::string out = one.path + "\n";
  out += "  task      " + std::string{ml::task_name(i.task)} + "\n  method    " + i.method + "\n  features ";
  for (const auto& name : i.features) out += " " + name;
  out += " (" + i.feature_set + ")\n";
  out += format("  data      %zu rows, %zu placements, %zu places by %s, digest %.16s\n", i.rows,
                i.placements, i.groups, i.group_by.c_str(), i.data_digest.c_str());
  out += format("  training  %zu folds, seed %llu, anchord %s\n", i.folds,
                static_cast<unsigned long long>(i.seed), i.code_version.c_str());
  if (one.model.classifier) out += format("  threshold %.3f\n", one.model.classifier->threshold);
  for (const auto& [name, value] : i.metrics) out += format("  %-22s %.4f\n", name.c_str(), value);
  if (!i.not_for_live.empty()) out += "  NOT FOR LIVE ranges: " + i.not_for_live + "\n";
  return out + "  why       " + i.why + "\n";
}

}  // namespace anchord::api
