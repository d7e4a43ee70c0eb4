#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "api/exports/model_report.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/learning_data.hpp"

namespace anchord::cli {
namespace {

struct ModelsArguments {
  std::vector<std::string> files;
  std::string folder{"."};
  bool json{false};
};

int list(const ModelsArguments& a) {
  std::error_code failed;
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(a.folder, failed))
    if (entry.is_regular_file() && entry.path().extension() == ".json")
      paths.push_back(entry.path().string());
  if (failed) return refuse("models", a.folder + ": " + failed.message());
  std::sort(paths.begin(), paths.end());
  std::vector<api::NamedModel> models;
  for (const auto& path : paths)  // other JSON files in the folder are none of ours
    if (auto model = read_model_file(path)) models.push_back({path, std::move(model).value()});
  std::fputs((a.json ? api::models_json(models) : api::models_text(models)).c_str(), stdout);
  return 0;
}

int show(const ModelsArguments& a) {
  std::vector<api::NamedModel> models;
  for (const auto& path : a.files) {
    auto model = read_model_file(path);
    if (!model) return refuse("models", model.error().message);
    models.push_back({path, std::move(model).value()});
  }
  std::string out = a.json ? api::models_json(models) : std::string{};
  if (!a.json)
    for (const auto& one : models) out += api::model_text(one);
  std::fputs(out.c_str(), stdout);
  return 0;
}

int check(const ModelsArguments& a) {
  bool good = true;
  for (const auto& path : a.files) {
    const auto model = read_model_file(path);
    good = good && model.has_value();
    if (model)
      std::printf("%s: good\n", path.c_str());
    else
      std::printf("%s\n", printable(model.error().message).c_str());
  }
  return good ? 0 : 2;
}

}  // namespace

void add_models_command(CLI::App& app, int& exit_code) {
  auto* models = app.add_subcommand("models", "List, show and check model artifacts of `anchord train`");
  models->require_subcommand(1);
  auto a = std::make_shared<ModelsArguments>();
  auto* listed = models->add_subcommand("list", "Every model artifact of a folder");
  listed->add_option("folder", a->folder, "Folder")->capture_default_str();
  listed->add_flag("--json", a->json, "One JSON document on standard output");
  listed->callback([a, &exit_code] { exit_code = list(*a); });
  auto* shown = models->add_subcommand("show", "Manifest of artifacts: task, features, data, metrics, why");
  shown->add_option("files", a->files, "Artifacts")->required();
  shown->add_flag("--json", a->json, "One JSON document on standard output");
  shown->callback([a, &exit_code] { exit_code = show(*a); });
  auto* checked = models->add_subcommand("check", "Read artifacts as a server would, and say what is wrong");
  checked->add_option("files", a->files, "Artifacts")->required();
  checked->callback([a, &exit_code] { exit_code = check(*a); });
}

}  // namespace anchord::cli
