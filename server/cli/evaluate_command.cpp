#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "api/learning/labelled_dataset.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/learning_data.hpp"
#include "server/cli/terminal_text.hpp"

namespace anchord::cli {
namespace {

struct EvaluateArguments {
  DataOptions data;
  std::string model;
  double threshold{-1};
  bool json{false};
};

struct Gathered {
  ml::Dataset data;
  api::RowReport report;
};

Result<Gathered> gather(const EvaluateArguments& a, const ml::ModelInfo& info) {
  BOOST_OUTCOME_TRY(const auto frozen, read_frozen(a.data));
  if (frozen) {
    BOOST_OUTCOME_TRY(auto rows, rows_for(a.data, *frozen, info.task, info.features));
    return Gathered{std::move(rows.data), std::move(rows.report)};
  }
  BOOST_OUTCOME_TRY(const auto table, read_data(a.data));
  Gathered out{{}, row_report(a.data, table)};
  out.report.warning.clear();  // nothing is split here
  std::vector<std::size_t> rows;
  api::Dropped dropped;
  auto data = api::dataset_from(
      table, {info.features, info.task == ml::Task::nlos_id, info.task != ml::Task::nlos_id}, rows, dropped);
  if (!data) return make_error(data.error().code, a.data.files.front() + ": " + data.error().message);
  add_dropped(out.report, dropped);
  take_features(out.report, info.features);
  out.data = std::move(data).value();
  return out;
}

int evaluate(const EvaluateArguments& a) {
  auto model = read_model_file(a.model);
  if (!model) return refuse("evaluate", model.error().message);
  if (a.threshold >= 0 && model.value().classifier) model.value().classifier->threshold = a.threshold;

  auto gathered = gather(a, model.value().info);
  if (!gathered) return refuse("evaluate", gathered.error().message);
  auto& [data, report] = gathered.value();
  const auto evaluation = ml::evaluate(model.value(), data);
  if (evaluation.rows == 0)
    return refuse("evaluate", a.data.files.front() + ": no row with the class of the model");
  report.used = evaluation.rows;
  const auto out = a.json ? api::evaluation_json(evaluation, model.value(), report)
                          : api::evaluation_text(evaluation, model.value(), report);
  std::fputs((a.json ? printable_json(out) : printable(out)).c_str(), stdout);
  return 0;
}

}  // namespace

void add_evaluate_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("evaluate", "Evaluate a trained model on a table of labelled ranges");
  auto a = std::make_shared<EvaluateArguments>();
  add_data_options(*command, a->data);
  command->add_option("--model", a->model, "Model artifact of `anchord train`")->required();
  command
      ->add_option("--threshold", a->threshold,
                   "P(LOS) from which a range is classified as LOS (default: that of the model)")
      ->check(CLI::Range(0.0, 1.0));
  command->add_flag("--json", a->json, "One JSON document on standard output");
  command->callback([a, &exit_code] { exit_code = evaluate(*a); });
}

}  // namespace anchord::cli
