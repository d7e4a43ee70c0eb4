#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>

#include "api/exports/plan_output.hpp"
#include "api/imports/plan_input.hpp"
#include "server/cli/commands.hpp"

namespace anchord::cli {
namespace {

/// The whole file, "-" for standard input; absent (and said on stderr) when it cannot be read.
std::optional<std::string> read_all(const std::string& path) {
  if (path == "-") return std::string(std::istreambuf_iterator<char>(std::cin), {});
  std::ifstream file(path, std::ios::binary);
  std::string out;
  if (file) out.assign(std::istreambuf_iterator<char>(file), {});
  if (!file) {
    std::fprintf(stderr, "anchord plan: cannot read %s\n", path.c_str());
    return std::nullopt;
  }
  return out;
}

void print_errors(const std::string& path, const std::vector<api::FieldError>& errors) {
  std::fprintf(stderr, "anchord plan: %s: %zu error%s\n", path.c_str(), errors.size(), errors.size() == 1 ? "" : "s");
  for (const auto& e : errors) {
    std::fprintf(stderr, "  %s: %s: %s%s%s\n", e.pointer.empty() ? "(document)" : e.pointer.c_str(), e.code.c_str(),
                 e.detail.c_str(), e.value_json.empty() ? "" : ", not ", e.value_json.c_str());
  }
}

int plan_next(const std::string& path, bool json) {
  const auto text = read_all(path);
  if (!text) return 2;
  std::vector<api::FieldError> errors;
  const auto request = api::read_plan_input(*text, errors);
  if (!request) {
    print_errors(path, errors);
    return 2;
  }
  const auto decision = planning::next_point(request->input, request->options);
  if (!decision) {
    std::fprintf(stderr, "anchord plan: %s: %s\n", path.c_str(), decision.error().message.c_str());
    return 2;
  }
  const auto out = json ? api::decision_json(decision.value(), *request) : api::decision_text(decision.value(), *request);
  std::fputs(out.c_str(), stdout);
  return decision.value().chosen ? 0 : 1;
}

}  // namespace

void add_plan_command(CLI::App& app, int& exit_code) {
  auto* plan = app.add_subcommand("plan", "Where to measure next, without a server");
  plan->require_subcommand(1);

  struct Next {
    std::string input;
    bool json{false};
  };
  auto next = std::make_shared<Next>();
  auto* command = plan->add_subcommand("next", "Best next point of a flight (docs/formats.md, Planner input)");
  command->add_option("INPUT", next->input, "JSON file, - for standard input")->required();
  command->add_flag("--json", next->json, "Print JSON instead of a table");
  command->callback([next, &exit_code] { exit_code = plan_next(next->input, next->json); });
}

}  // namespace anchord::cli
