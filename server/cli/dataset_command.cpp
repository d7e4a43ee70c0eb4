#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <memory>

#include "api/formats/cells.hpp"
#include "api/learning/freeze_rows.hpp"
#include "api/learning/labelled_dataset.hpp"
#include "core/base/text.hpp"
#include "core/base/whole_file.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/learning_data.hpp"
#include "server/cli/words.hpp"

namespace anchord::cli {
namespace {

struct DatasetArguments {
  DataOptions data;
  std::string out, file, digest, campaign;
  api::Aggregation aggregate{api::Aggregation::none};
  std::vector<std::string> held_out;
  bool keep_outliers{false};
  double held_out_share{0};
  std::uint64_t seed{1};
};

void print_set(const api::FrozenDataset& set, const std::string& digest) {
  std::printf("digest %s\n%s", digest.c_str(), printable(api::split_report_text(set)).c_str());
}

/// What the columns were taken for, and what of the table was not used.
void print_columns(const api::LabelledTable& table) {
  if (!table.los_value.empty())
    std::printf("class: %s of column %s is LOS\n", printable(table.los_value).c_str(),
                printable(table.label_column).c_str());
  if (const auto unused = api::listed_briefly(table.unused); !unused.empty())
    std::printf("columns not used: %s\n", printable(unused).c_str());
  for (const auto& warning : table.warnings) std::printf("warning: %s\n", printable(warning).c_str());
}

int build(const DatasetArguments& a) {
  const auto table = read_data(a.data);
  if (!table) return refuse("dataset", table.error().message);
  api::FreezeOptions how;
  how.aggregation = a.aggregate;
  how.filter_faults = !a.keep_outliers;
  how.test = a.held_out;
  how.test_share = a.held_out_share;
  how.seed = a.seed;
  std::map<std::string, std::size_t> dropped;
  for (const auto& [reason, entry] : table.value().dropped)
    dropped[reason + " (first " + entry.second + ")"] = entry.first;
  const auto set = api::freeze_rows(api::dataset_rows(table.value(), a.campaign), how, std::move(dropped));
  if (!set) return refuse("dataset", a.data.files.front() + ": " + set.error().message);
  const auto csv = set.value().table.csv();
  if (const auto written = write_whole(a.out, csv); !written)
    return failed("anchord dataset", written.error().message);
  print_set(set.value(), api::dataset_digest(csv));
  print_columns(table.value());
  return 0;
}

int check(const DatasetArguments& a) {
  DataOptions data;
  data.files = {a.file};
  auto frozen = read_frozen(data);
  if (!frozen) return refuse("dataset", frozen.error().message);
  if (!frozen.value())
    return refuse("dataset", a.file +
                                 ": not a frozen data set; `anchord dataset build` and GET "
                                 "/datasets/{id}/rows?format=csv make one");
  const auto digest = frozen.value()->digest;
  print_set(api::frozen_before(std::move(frozen.value()->table)), digest);
  if (a.digest.empty() || a.digest == digest) return 0;
  return refuse("dataset", a.file + ": its digest is not " + a.digest);
}

}  // namespace

void add_dataset_command(CLI::App& app, int& exit_code) {
  auto* dataset = app.add_subcommand("dataset", "Freeze labelled ranges into a data set, and check one");
  dataset->require_subcommand(1);
  auto a = std::make_shared<DatasetArguments>();
  auto* built = dataset->add_subcommand(
      "build", "Aggregate, split by whole places, check for leaks, compute the digest");
  add_data_options(*built, a->data);
  add_word(*built, "--aggregate", a->aggregate, api::k_aggregation_words,
           "none (single ranges, as flights have them), or mean or median of each "
           "measurement point: models of these are not for live ranges");
  built->add_option("--hold-out", a->held_out, "Places held out for the final test")->delimiter(',');
  built
      ->add_option("--hold-out-share", a->held_out_share,
                   "Or the share of places to hold out, drawn with the seed")
      ->check(CLI::Range(0.0, 0.9));
  built->add_option("--seed", a->seed, "Seed of that draw")->capture_default_str();
  built->add_option("--campaign", a->campaign, "Name of the campaign (default: that of the file)");
  built->add_flag("--keep-outliers", a->keep_outliers, "Keep ranges far off the median of their placement");
  built->add_option("--out", a->out, "CSV to write; `anchord train --data` and POST /datasets read it")
      ->required();
  built->callback([a, &exit_code] { exit_code = build(*a); });
  auto* checked = dataset->add_subcommand("check", "Read a data set again: digest, split, leak report");
  checked->add_option("file", a->file, "CSV of `anchord dataset build` or of a server")->required();
  checked->add_option("--digest", a->digest, "Fail if the digest differs");
  checked->callback([a, &exit_code] { exit_code = check(*a); });
}

}  // namespace anchord::cli
