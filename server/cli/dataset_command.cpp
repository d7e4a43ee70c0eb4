#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>

#include "api/imports/dataset_csv.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/learning_data.hpp"

namespace anchord::cli {
namespace {

struct DatasetArguments {
  DataOptions data;
  std::string out, file, aggregate{"mean"};
  std::vector<std::string> features, held_out;
  double held_out_share{0};
  std::uint64_t seed{1};
};

void print_set(const ml::FrozenDataset& set) {
  const auto& s = set.split;
  std::printf("digest %s\naggregation %s, %zu features\n", set.digest.c_str(),
              std::string{ml::aggregation_name(set.aggregation)}.c_str(), set.data.columns());
  std::printf("train %zu rows, %zu placements, %zu places\n", s.train_rows, s.train_placements,
              s.train_places);
  std::printf("test  %zu rows, %zu placements, %zu places", s.test_rows, s.test_placements, s.test_places);
  for (const auto& name : s.test_place_names) std::printf(" %s", name.c_str());
  std::printf("\nleak  %s: %zu placements in more than one place, %zu rows equal to rows of other places\n",
              s.leak ? "YES" : "none", s.shared_placements, s.duplicate_rows);
}

int build(const DatasetArguments& a) {
  const auto table = read_data(a.data);
  if (!table) return refuse("dataset", table.error().message);
  api::SetRequest request{a.features, false, false};
  if (request.features.empty()) request.features = api::available_features(table.value(), true);
  std::vector<std::size_t> rows;
  std::map<std::string, std::size_t> dropped;
  const auto data = api::dataset_from(table.value(), request, rows, dropped);
  if (!data) return refuse("dataset", data.error().message);
  const auto set =
      ml::freeze(data.value(), {*ml::aggregation_of(a.aggregate), a.held_out, a.held_out_share, a.seed});
  if (!set) return refuse("dataset", set.error().message);
  std::ofstream file(a.out, std::ios::binary);
  file << api::write_dataset_csv(set.value());
  if (!file.flush()) {
    std::fprintf(stderr, "anchord dataset: cannot write %s\n", a.out.c_str());
    return 1;
  }
  for (const auto& [reason, count] : dropped) std::printf("dropped %zu: %s\n", count, reason.c_str());
  print_set(set.value());
  return 0;
}

int check(const DatasetArguments& a) {
  std::ifstream file(a.file, std::ios::binary);
  if (!file) return refuse("dataset", a.file + ": cannot be read");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const auto set = api::read_dataset_csv(text);
  if (!set) return refuse("dataset", a.file + ": " + set.error().message);
  print_set(set.value());
  return 0;
}

}  // namespace

void add_dataset_command(CLI::App& app, int& exit_code) {
  auto* dataset = app.add_subcommand("dataset", "Freeze labelled rangings into a data set, and check one");
  dataset->require_subcommand(1);
  auto a = std::make_shared<DatasetArguments>();
  auto* built =
      dataset->add_subcommand("build", "Aggregate, split by whole places, look for leaks, take the digest");
  add_data_options(*built, a->data);
  built->add_option("--features", a->features, "Features by name (default: all there are)")->delimiter(',');
  built->add_option("--aggregate", a->aggregate, "none, mean or median of each measurement point")
      ->check(CLI::IsMember({"none", "mean", "median"}))
      ->capture_default_str();
  built->add_option("--hold-out", a->held_out, "Places for the final test")->delimiter(',');
  built->add_option("--hold-out-share", a->held_out_share, "Or this share of the places, drawn by the seed")
      ->check(CLI::Range(0.0, 0.9));
  built->add_option("--seed", a->seed, "Seed of that draw")->capture_default_str();
  built->add_option("--out", a->out, "CSV to write; `anchord train --data` reads it")->required();
  built->callback([a, &exit_code] { exit_code = build(*a); });
  auto* checked = dataset->add_subcommand("check", "Read a data set again: digest, split, leak report");
  checked->add_option("file", a->file, "CSV of `anchord dataset build`")->required();
  checked->callback([a, &exit_code] { exit_code = check(*a); });
}

}  // namespace anchord::cli
