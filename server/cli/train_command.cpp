#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>

#include "api/json/model_artifact.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/learning_data.hpp"

namespace anchord::cli {
namespace {

struct TrainArguments {
  DataOptions data;
  std::string task{"nlos_id"}, method{"auto"}, out{};
  std::vector<std::string> features;
  std::size_t folds{10};
  std::uint64_t seed{1};
  std::size_t per_placement{5};
  double max_fpr{-1};
  bool grid{false}, json{false};
};

// Written beside and renamed, so that a run that dies leaves no half model.
bool write_whole(const std::string& path, const std::string& text) {
  const std::string beside = path + ".part";
  std::ofstream file(beside, std::ios::binary);
  file << text;
  file.close();
  std::error_code failed;
  if (file) std::filesystem::rename(beside, path, failed);
  if (!file || failed) std::filesystem::remove(beside, failed);
  return static_cast<bool>(file) && !failed;
}

// Faults leave before training (6.2.1): ranges far off their placement's median.
void drop_outliers(ml::Dataset& data, const std::vector<std::size_t>& rows, const api::LabelledTable& table,
                   api::RowReport& report) {
  std::vector<double> range;
  for (const auto i : rows) range.push_back(table.range_m[i]);
  const auto faults = ml::range_outliers(range, data.placement);
  if (faults.empty()) return;
  const std::set<std::size_t> faulty(faults.begin(), faults.end());
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < data.rows(); ++i)
    if (!faulty.contains(i)) kept.push_back(i);
  report.dropped["range more than 8 MAD off its placement's median"].first += faults.size();
  data = data.subset(kept);
}

int train(const TrainArguments& a) {
  const auto task = ml::task_of(a.task);
  if (!task) return refuse("train", "--task is nlos_id, los_bias, nlos_bias or bias, not " + a.task);
  std::optional<ml::Method> method;
  if (a.method != "auto") {
    method = ml::method_of(a.method);
    if (!method) return refuse("train", "unknown --method " + a.method);
  }
  const auto table = read_data(a.data);
  if (!table) return refuse("train", table.error().message);
  auto report = row_report(a.data, table.value());

  api::SetRequest request{
      a.features, *task == ml::Task::nlos_id || *task == ml::Task::los_bias || *task == ml::Task::nlos_bias,
      *task != ml::Task::nlos_id};
  if (*task != ml::Task::nlos_id && *task != ml::Task::bias && !table.value().labelled())
    request.need_label = false;
  if (request.features.empty())
    request.features = api::available_features(table.value(), *task == ml::Task::nlos_id);
  std::vector<std::size_t> rows;
  std::map<std::string, std::size_t> dropped;
  auto data = api::dataset_from(table.value(), request, rows, dropped);
  if (!data) return refuse("train", a.data.files.front() + ": " + data.error().message);
  add_dropped(report, dropped);
  drop_outliers(data.value(), rows, table.value(), report);
  if (data.value().labelled() && (*task == ml::Task::los_bias || *task == ml::Task::nlos_bias)) {
    data = data.value().of_class(*task == ml::Task::los_bias);
    if (data.value().rows() == 0)
      return refuse("train",
                    a.data.files.front() + ": no row of the class in column " + table.value().label_column);
  }
  report.used = data.value().rows();

  ml::LearnOptions options;
  options.task = *task, options.features = a.features, options.folds = a.folds, options.seed = a.seed;
  options.per_placement = a.per_placement, options.search = a.grid, options.run.threads = 0;
  if (method) options.methods = {*method};
  if (a.max_fpr >= 0) options.max_fpr = a.max_fpr;
  auto learned = ml::learn(data.value(), options);
  if (!learned) return refuse("train", a.data.files.front() + ": " + learned.error().message);
  auto& info = learned.value().model.info;
  info.feature_set = nlos::k_feature_set_version;
  info.group_by = report.group_by.empty() ? "row" : report.group_by;
  info.code_version = ANCHORD_VERSION;
  if (!write_whole(a.out, api::write_model_artifact(learned.value().model))) {
    std::fprintf(stderr, "anchord train: cannot write %s\n", a.out.c_str());
    return 1;
  }
  const auto text = a.json ? api::train_json(learned.value(), report, a.out)
                           : api::train_text(learned.value(), report, a.out);
  std::fputs(text.c_str(), stdout);
  return 0;
}

}  // namespace

void add_train_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "train", "Fit a model of line of sight or range bias to a table of labelled rangings");
  auto a = std::make_shared<TrainArguments>();
  add_data_options(*command, a->data);
  command->add_option("--task", a->task, "nlos_id, los_bias, nlos_bias or bias")->capture_default_str();
  command
      ->add_option("--method", a->method,
                   "auto, or one of logistic, random_forest, svm, boosted, average, constant, polynomial, "
                   "multivariate, least_absolute")
      ->capture_default_str();
  command->add_option("--features", a->features, "Features by name (default: chosen with the method)")
      ->delimiter(',');
  command->add_option("--folds", a->folds, "Folds of whole places")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  command->add_option("--seed", a->seed, "Seed of folds and trees")->capture_default_str();
  command
      ->add_option("--per-placement", a->per_placement,
                   "Rows of one placement used for training; repeats are near copies")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      ->add_option("--max-fpr", a->max_fpr,
                   "Choose the threshold so that at most this share of held-out NLOS is called LOS")
      ->check(CLI::Range(0.0, 1.0));
  command->add_flag("--grid", a->grid, "Search the declared grid of settings as well");
  command->add_option("--out", a->out, "Model artifact to write")->required();
  command->add_flag("--json", a->json, "One JSON document on standard output");
  command->callback([a, &exit_code] { exit_code = train(*a); });
}

}  // namespace anchord::cli
