#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "api/learning/labelled_dataset.hpp"
#include "api/learning/model_artifact.hpp"
#include "core/base/text.hpp"
#include "core/base/whole_file.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/learning_data.hpp"
#include "server/cli/terminal_text.hpp"
#include "server/cli/words.hpp"

namespace anchord::cli {
namespace {

struct TrainArguments {
  DataOptions data;
  ml::Task task{ml::Task::nlos_id};
  ml::Engine engine{ml::Engine::own};
  std::string out{};
  std::vector<std::string> methods{"auto"}, features;
  std::size_t folds{10};
  std::uint64_t seed{1};
  std::size_t per_placement{5};
  double max_fpr{-1}, held_out_share{0};
  std::vector<std::string> tries, held_out;
  std::size_t threads{0};
  bool grid{false}, importance{false}, selection{false}, json{false};
};

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

// "svm.c=1,10,100" into the grid.
Result<void> read_try(const std::string& text, ml::Grid& grid) {
  const auto dot = text.find('.'), equals = text.find('=');
  const auto method = ml::method_of(text.substr(0, dot));
  if (dot == std::string::npos || equals == std::string::npos || equals < dot || !method)
    return make_error(Errc::invalid_argument, "--try must be method.setting=value,value, not " + text);
  auto& values = grid[*method][text.substr(dot + 1, equals - dot - 1)];
  for (std::size_t at = equals + 1; at <= text.size();) {
    const auto end = std::min(text.find(',', at), text.size());
    char* stopped = nullptr;
    const std::string one = text.substr(at, end - at);
    values.push_back(std::strtod(one.c_str(), &stopped));
    if (one.empty() || *stopped != 0)
      return make_error(Errc::invalid_argument, "--try: no number in \"" + one + "\" of " + text);
    at = end + 1;
  }
  return boost::outcome_v2::success();
}

struct GatheredTraining {
  ml::Dataset data;
  api::RowReport report;
  std::vector<std::string> held_out;  // a frozen data set's own test places
  std::string digest;                 // of a frozen data set
  std::string not_for_live{};         // why its rows are not as live ranges are
  std::string feature_set{nlos::k_feature_set_version};
};

Result<GatheredTraining> gather_table(const TrainArguments& a, ml::Task task) {
  BOOST_OUTCOME_TRY(const auto table, read_data(a.data));
  GatheredTraining out;
  out.report = row_report(a.data, table);
  api::SetRequest request{
      a.features, task == ml::Task::nlos_id || task == ml::Task::los_bias || task == ml::Task::nlos_bias,
      task != ml::Task::nlos_id};
  if (task != ml::Task::nlos_id && task != ml::Task::bias && !table.labelled()) request.need_label = false;
  std::map<std::string, std::size_t> lacking;
  if (request.features.empty())
    request.features = api::available_features(table, task == ml::Task::nlos_id, lacking);
  for (const auto& [feature, n] : lacking)
    std::fprintf(stderr,
                 "anchord train: %s is not used, %zu of %zu rows lack it: name it in --features to leave out "
                 "those rows\n",
                 feature.c_str(), n, table.rows());
  std::vector<std::size_t> rows;
  api::Dropped dropped;
  auto data = api::dataset_from(table, request, rows, dropped);
  if (!data) return make_error(data.error().code, a.data.files.front() + ": " + data.error().message);
  add_dropped(out.report, dropped);
  take_features(out.report, request.features);
  out.data = std::move(data).value();
  drop_outliers(out.data, rows, table, out.report);
  return out;
}

Result<GatheredTraining> gather(const TrainArguments& a, ml::Task task) {
  BOOST_OUTCOME_TRY(const auto frozen, read_frozen(a.data));
  if (frozen) {
    BOOST_OUTCOME_TRY(auto rows, rows_for(a.data, *frozen, task, a.features));
    return GatheredTraining{std::move(rows.data), std::move(rows.report), std::move(rows.held_out),
                            rows.digest,          rows.not_for_live,      rows.feature_set};
  }
  BOOST_OUTCOME_TRY(auto out, gather_table(a, task));
  if (out.data.labelled() && (task == ml::Task::los_bias || task == ml::Task::nlos_bias)) {
    out.data = out.data.of_class(task == ml::Task::los_bias);
    if (out.data.rows() == 0)
      return make_error(Errc::too_few_observations,
                        a.data.files.front() + ": no row of the class in column " + out.report.label);
  }
  out.report.used = out.data.rows();
  return out;
}

int train(const TrainArguments& a) {
  std::vector<ml::Method> methods;
  for (const auto& name : a.methods) {
    if (name == "auto") continue;
    const auto method = ml::method_of(name);
    if (!method)
      return refuse("train", unknown_word("--method", name, ml::k_method_words.words()).message + ", auto");
    methods.push_back(*method);
  }
  ml::TrainingSpec asked;
  asked.task = a.task;
  asked.methods = methods;
  asked.engine = a.engine;
  if (const auto able = asked.check(); !able) return refuse("train", able.error().message);
  const auto gathered = gather(a, a.task);
  if (!gathered) return refuse("train", gathered.error().message);
  const auto& [data, report, frozen_test, digest, not_for_live, feature_set] = gathered.value();

  ml::TrainingSpec spec;
  spec.task = a.task;
  spec.features = a.features;
  spec.folds = a.folds;
  spec.seed = a.seed;
  spec.methods = methods;
  spec.engine = a.engine;
  spec.per_placement = a.per_placement;
  spec.search = a.grid;
  spec.threads = a.threads;
  spec.held_out = a.held_out.empty() ? frozen_test : a.held_out;
  spec.held_out_share = a.held_out_share;
  spec.importance = a.importance;
  spec.selection = a.selection;
  if (a.max_fpr >= 0) spec.max_fpr = a.max_fpr;
  for (const auto& one : a.tries) {
    const auto read = read_try(one, spec.grid);
    if (!read) return refuse("train", read.error().message);
  }
  auto learned = ml::train(data, spec);
  if (!learned) return refuse("train", a.data.files.front() + ": " + learned.error().message);
  auto& info = learned.value().model.info;
  info.feature_set = feature_set;
  info.group_by = report.group_by.empty() ? "row" : report.group_by;
  info.code_version = ANCHORD_VERSION;
  info.not_for_live = not_for_live;
  if (!digest.empty()) info.data_digest = digest;
  const auto artifact = api::checked_model_artifact(learned.value().model);
  if (!artifact) return refuse("train", a.data.files.front() + ": " + artifact.error().message);
  if (const auto written = write_whole(a.out, artifact.value()); !written)
    return failed("anchord train", written.error().message);
  const auto text = a.json ? api::train_json(learned.value(), report, a.out)
                           : api::train_text(learned.value(), report, a.out);
  std::fputs((a.json ? printable_json(text) : printable(text)).c_str(), stdout);
  return 0;
}

}  // namespace

void add_train_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "train", "Train a model of line of sight or range bias on a table of labelled ranges");
  auto a = std::make_shared<TrainArguments>();
  add_data_options(*command, a->data);
  add_word(*command, "--task", a->task, ml::k_task_words, "Task of the model");
  command
      ->add_option(
          "--method", a->methods,
          "auto, or one or more of logistic, random_forest, svm, boosted, average, tree_average, constant, "
          "polynomial, multivariate, least_absolute: the best of them on held-out places")
      ->delimiter(',')
      ->capture_default_str();
  add_word(*command, "--engine", a->engine, ml::k_engine_words,
           "own (libsvm and anchord's own trees) or opencv, which has svm and random_forest");
  command->add_option("--features", a->features, "Names of features (default: chosen with the method)")
      ->delimiter(',');
  command->add_option("--folds", a->folds, "Number of folds over places")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  command->add_option("--seed", a->seed, "Seed of folds and trees")->capture_default_str();
  command
      ->add_option("--per-placement", a->per_placement,
                   "Rows of one placement used for training; repeated measurements are almost copies")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      ->add_option("--max-fpr", a->max_fpr,
                   "Choose the threshold so that at most this share of held-out NLOS is classified as LOS")
      ->check(CLI::Range(0.0, 1.0));
  command->add_flag("--grid", a->grid, "Also search the predefined grid of settings");
  command->add_option("--try", a->tries,
                      "Values of one setting to search, like svm.c=1,10,100; repeat for more settings");
  command->add_option("--hold-out", a->held_out, "Places held out of training for the final test")
      ->delimiter(',');
  command
      ->add_option("--hold-out-share", a->held_out_share,
                   "Or the share of places to hold out, drawn with the seed")
      ->check(CLI::Range(0.0, 0.9));
  command->add_flag("--importance", a->importance, "Rank the features by out-of-bag permutation importance");
  command->add_flag("--selection", a->selection, "Forward filter of the features in the order of importance");
  command
      ->add_option("--threads", a->threads, "Threads (default: all cores); the model does not depend on it")
      ->check(CLI::Range(0, 1024));
  command->add_option("--out", a->out, "Model artifact to write")->required();
  command->add_flag("--json", a->json, "One JSON document on standard output");
  command->callback([a, &exit_code] { exit_code = train(*a); });
}

}  // namespace anchord::cli
