#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "api/formats/rule_samples.hpp"
#include "api/learning/rule_report.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/learning_data.hpp"
#include "server/cli/terminal_text.hpp"

namespace anchord::cli {
namespace {

struct RulesArguments {
  DataOptions data;
  std::uint64_t seed{1};
  bool json{false};
};

Result<api::RuleReport> evaluate(const RulesArguments& a, const std::string& file) {
  DataOptions one = a.data;
  one.files = {file};
  BOOST_OUTCOME_TRY(const auto table, read_data(one));
  if (!table.labelled())
    return make_error(Errc::not_found,
                      file + ": no label column (nlos, los, label, cls): name it with --label");
  const auto samples = api::rule_samples(table);
  api::RuleReport report;
  // data/hall/rangings.csv.gz is best known by its folder and name.
  const std::filesystem::path path{file};
  report.data_set = (path.parent_path().filename() / path.filename()).string();
  for (const auto& s : samples) (s.los ? report.los_rows : report.nlos_rows) += 1;
  report.printed = nlos::evaluate_rules(nlos::printed_rules(), samples);
  report.fitted = nlos::evaluate_fitted_rules(samples, ml::grouped_folds(table.group, 10, a.seed));
  report.rules = nlos::fit_rules(samples);
  return report;
}

int rules(const RulesArguments& a) {
  std::vector<api::RuleReport> reports;
  for (const auto& file : a.data.files) {
    auto report = evaluate(a, file);
    if (!report) return refuse("rules", report.error().message);
    reports.push_back(std::move(report).value());
  }
  const auto out = a.json ? printable_json(api::rules_json(reports)) : printable(api::rules_text(reports));
  std::fputs(out.c_str(), stdout);
  return 0;
}

}  // namespace

void add_rules_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "rules",
      "Evaluate the simple rules for line of sight (RSS line, thresholds, weighted vote) on data sets");
  auto a = std::make_shared<RulesArguments>();
  add_data_options(*command, a->data);
  command->add_option("--seed", a->seed, "Seed of the folds over places")->capture_default_str();
  command->add_flag("--json", a->json, "One JSON document on standard output");
  command->callback([a, &exit_code] { exit_code = rules(*a); });
}

}  // namespace anchord::cli
