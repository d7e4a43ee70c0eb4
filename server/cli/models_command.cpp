#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "api/learning/model_artifact.hpp"
#include "api/learning/model_report.hpp"
#include "api/learning/model_signer.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/learning_data.hpp"
#include "server/cli/terminal_text.hpp"

namespace anchord::cli {
namespace {

struct ModelsArguments {
  std::vector<std::string> files;
  std::string folder{"."}, data_dir;
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
  const auto out = a.json ? printable_json(api::models_json(models)) : printable(api::models_text(models));
  std::fputs(out.c_str(), stdout);
  return 0;
}

int show(const ModelsArguments& a) {
  std::vector<api::NamedModel> models;
  for (const auto& path : a.files) {
    auto model = read_model_file(path);
    if (!model) return refuse("models", model.error().message);
    models.push_back({path, std::move(model).value()});
  }
  std::string out = a.json ? printable_json(api::models_json(models)) : std::string{};
  if (!a.json)
    for (const auto& one : models) out += printable(api::model_text(one));
  std::fputs(out.c_str(), stdout);
  return 0;
}

/// The key a data folder's server signs with; nothing where none is named.
Result<std::optional<api::ModelSigner>> signer_of(const std::string& data_dir) {
  if (data_dir.empty()) return std::optional<api::ModelSigner>{};
  const std::string file = data_dir + "/models.key";
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  if (!in) return make_error(Errc::not_found, file + ": cannot be read");
  BOOST_OUTCOME_TRY(const auto seed, api::ModelSigner::parse_seed(text));
  return std::optional<api::ModelSigner>(api::ModelSigner(seed));
}

/// In words; false where the file was edited after that server signed it.
bool signature_words(const std::string& path, const ml::Model& model, const api::ModelSigner* signer,
                     std::string& words) {
  std::ifstream in(path, std::ios::binary);
  const std::string signature = api::signature_in(std::string{std::istreambuf_iterator<char>(in), {}});
  words = signature.empty() ? "not signed" : "signed, " + signature.substr(0, signature.rfind(':'));
  if (signature.empty() || signer == nullptr) return true;
  const auto standing = signer->standing(api::write_model_artifact(model), signature);
  words = standing == api::ModelStanding::changed ? "CHANGED after it was signed by this server"
          : standing == api::ModelStanding::foreign
              ? "signed by another server"
              : "signed by this server, " + std::string(to_string(standing));
  return standing != api::ModelStanding::changed;
}

int check(const ModelsArguments& a) {
  const auto signer = signer_of(a.data_dir);
  if (!signer) return refuse("models", signer.error().message);
  bool good = true;
  for (const auto& path : a.files) {
    const auto model = read_model_file(path);
    if (!model) {
      good = false;
      std::printf("%s\n", printable(model.error().message).c_str());
      continue;
    }
    std::string words;
    const bool kept =
        signature_words(path, model.value(), signer.value() ? &*signer.value() : nullptr, words);
    good = good && kept;
    std::printf("%s: %s, %s\n", printable(path).c_str(), kept ? "good" : "bad", words.c_str());
  }
  return good ? 0 : 2;
}

}  // namespace

void add_models_command(CLI::App& app, int& exit_code) {
  auto* models = app.add_subcommand("models", "List, show and check model artifacts of `anchord train`");
  models->require_subcommand(1);
  auto a = std::make_shared<ModelsArguments>();
  auto* listed = models->add_subcommand("list", "List the model artifacts in a folder");
  listed->add_option("folder", a->folder, "Folder")->capture_default_str();
  listed->add_flag("--json", a->json, "One JSON document on standard output");
  listed->callback([a, &exit_code] { exit_code = list(*a); });
  auto* shown = models->add_subcommand(
      "show", "Print the manifest of artifacts: task, features, data, metrics, reason for the choice");
  shown->add_option("files", a->files, "Artifacts")->required();
  shown->add_flag("--json", a->json, "One JSON document on standard output");
  shown->callback([a, &exit_code] { exit_code = show(*a); });
  auto* checked =
      models->add_subcommand("check", "Check artifacts as a server does, and print what is wrong");
  checked->add_option("files", a->files, "Artifacts")->required();
  checked->add_option("--data-dir", a->data_dir, "Data folder of the server whose signatures are verified");
  checked->callback([a, &exit_code] { exit_code = check(*a); });
}

}  // namespace anchord::cli
