#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>

#include "api/formats/flight_plan_output.hpp"
#include "api/formats/kml_plan.hpp"
#include "api/formats/outline_geojson.hpp"
#include "api/formats/plan_export.hpp"
#include "api/formats/plan_input.hpp"
#include "api/formats/plan_output.hpp"
#include "core/base/text.hpp"
#include "core/planning/local_plan.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/terminal_text.hpp"
#include "server/cli/words.hpp"

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
  std::fprintf(stderr, "anchord plan: %s: %zu error%s\n", path.c_str(), errors.size(),
               errors.size() == 1 ? "" : "s");
  for (const auto& e : errors) {
    std::fprintf(stderr, "  %s: %s: %s%s%s\n", e.pointer.empty() ? "(document)" : e.pointer.c_str(),
                 e.code.c_str(), printable(e.detail).c_str(), e.value_json.empty() ? "" : ", not ",
                 e.value_json.c_str());
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
    std::fprintf(stderr, "anchord plan: %s: %s\n", path.c_str(), printable(decision.error().message).c_str());
    return 2;
  }
  const auto out =
      json ? api::decision_json(decision.value(), *request) : api::decision_text(decision.value(), *request);
  std::fputs((json ? printable_json(out) : printable(out)).c_str(), stdout);
  return decision.value().chosen ? 0 : 1;
}

std::optional<api::OutlineRequest> outline_of_kml(const std::string& text,
                                                  std::vector<api::FieldError>& errors) {
  std::vector<std::string> notes;
  const Plan plan = api::read_kml_plan(text, notes, errors);
  for (const auto& note : notes) std::fprintf(stderr, "anchord plan: %s\n", printable(note).c_str());
  if (errors.empty() && plan.outline.empty())
    errors.push_back({"", "required", "no polygon is marked as the outline of the building", ""});
  if (!errors.empty()) return std::nullopt;
  const auto local = planning::local_plan(plan);
  if (!local) {
    errors.push_back({"", "out_of_range", local.error().message, ""});
    return std::nullopt;
  }
  const auto& l = local.value();
  return api::OutlineRequest{l.origin, {l.outline, plan.building_height_m, l.no_fly, l.fence}};
}

/// Any plan file we read, said as one we write.
int plan_import(const std::string& path, const std::string& format, api::Autopilot autopilot) {
  const auto text = read_all(path);
  if (!text) return 2;
  std::vector<api::FieldError> errors;
  std::vector<std::string> notes;
  const Plan plan = api::read_plan_file(*text, notes, errors);
  for (const auto& note : notes) std::fprintf(stderr, "anchord plan: %s\n", printable(note).c_str());
  if (!errors.empty()) {
    print_errors(path, errors);
    return 2;
  }
  const auto out = format == "plan" ? api::plan_qgc(plan, autopilot) : api::plan_geojson(plan);
  if (!out) {
    std::fprintf(stderr, "anchord plan: %s: %s\n", path.c_str(), printable(out.error().message).c_str());
    return 2;
  }
  std::fputs(out.value().c_str(), stdout);
  return 0;
}

void add_autopilot(CLI::App& command, api::Autopilot& autopilot) {
  add_word(
      command, "--autopilot", autopilot, api::k_autopilot_words,
      "whose mission items a .plan has: px4 takes headings from the waypoints and no turns, ardupilot needs "
      "changes of yaw");
}

void add_import(CLI::App& plan, int& exit_code) {
  struct Import {
    std::string file, format{"geojson"};
    api::Autopilot autopilot{};
  };
  auto import = std::make_shared<Import>();
  auto* command = plan.add_subcommand(
      "import", "Outline, areas and waypoints of a .plan, GeoJSON or KML file, as GeoJSON or .plan");
  command->add_option("FILE", import->file, "the file, - for standard input")->required();
  command->add_option("--format", import->format, "geojson, or plan (QGroundControl)")
      ->check(CLI::IsMember({"geojson", "plan"}))
      ->capture_default_str();
  add_autopilot(*command, import->autopilot);
  command->callback(
      [import, &exit_code] { exit_code = plan_import(import->file, import->format, import->autopilot); });
}

struct Flight {
  std::string outline, format{"json"};
  api::Autopilot autopilot{};
  double building_height_m{0};
  planning::FlightPlanOptions options;
};

int plan_flight(const Flight& flight) {
  const auto text = read_all(flight.outline);
  if (!text) return 2;
  std::vector<api::FieldError> errors;
  std::optional<api::OutlineRequest> request;
  if (text->find_first_not_of(" \t\r\n\xEF\xBB\xBF") == text->find('<') &&
      text->find('<') != std::string::npos)
    request = outline_of_kml(*text, errors);
  else
    request = api::read_outline(*text, errors);
  if (!request) {
    print_errors(flight.outline, errors);
    return 2;
  }
  if (flight.building_height_m > 0) request->input.building_height_m = flight.building_height_m;
  const auto& options = flight.options;
  const auto plan = planning::plan_flight(request->input, options);
  if (!plan) {
    std::fprintf(stderr, "anchord plan: %s: %s\n", flight.outline.c_str(),
                 printable(plan.error().message).c_str());
    return plan.error().code == Errc::invalid_argument ? 2 : 1;
  }
  std::string out;
  if (flight.format == "plan")
    out = api::plan_qgc(api::flight_as_plan(plan.value(), request->input, request->origin, options),
                        flight.autopilot)
              .value();
  else if (flight.format == "geojson")
    out = api::flight_plan_geojson(plan.value(), request->origin);
  else
    out = api::flight_plan_json(plan.value(), request->origin);
  std::fputs(out.c_str(), stdout);
  return 0;
}

void add_flight(CLI::App& plan, int& exit_code) {
  auto flight = std::make_shared<Flight>();
  auto& o = flight->options;
  auto* command = plan.add_subcommand(
      "flight", "Compute the waypoints of a whole flight from the outline of the building");
  command
      ->add_option("OUTLINE", flight->outline,
                   "GeoJSON or KML (docs/formats.md, Outline), - for standard input")
      ->required();
  command->add_option("--format", flight->format, "json, plan (QGroundControl) or geojson")
      ->check(CLI::IsMember({"json", "plan", "geojson"}));
  add_autopilot(*command, flight->autopilot);
  add_word(*command, "--rule,--criterion", o.rule, planning::k_rule_words,
           "a_optimal: mean error; d_optimal: error volume; dissertation chooses single points and cannot be "
           "used here");
  command->add_option("--height", flight->building_height_m,
                      "height of the building in m [height_m of the outline, else 6]");
  command->add_option("--keep-out", o.keep_out_m, "distance from the outline in m")->capture_default_str();
  command
      ->add_option("--heights", o.heights_m, "heights to measure at, in m above ground, separated by commas")
      ->delimiter(',');
  command->add_option("--max-points", o.max_points, "largest number of measuring points")
      ->capture_default_str();
  command
      ->add_option("--min-gain", o.min_gain, "stop when a point improves the result by less than this share")
      ->capture_default_str();
  command->add_option("--max-range", o.max_range_m, "largest range, in m")->capture_default_str();
  command->add_option("--speed", o.speed_mps, "m/s")->capture_default_str();
  command->add_option("--dwell", o.dwell_s, "seconds at each measuring point")->capture_default_str();
  command->callback([flight, &exit_code] { exit_code = plan_flight(*flight); });
}

}  // namespace

void add_plan_command(CLI::App& app, int& exit_code) {
  auto* plan = app.add_subcommand("plan", "Plan where to measure, without a server");
  plan->require_subcommand(1);

  struct Next {
    std::string input;
    std::string format{"json"};
    bool json{false};
  };
  auto next = std::make_shared<Next>();
  auto* command = plan->add_subcommand(
      "next", "Compute the best next point of a flight (docs/formats.md, Planner input)");
  command->add_option("INPUT", next->input, "JSON file, - for standard input")->required();
  auto* format = command->add_option("--format", next->format, "json, or table")
                     ->check(CLI::IsMember({"json", "table"}))
                     ->capture_default_str();
  command->add_flag("--json", next->json, "the same as --format json")->excludes(format);
  command->callback([next, &exit_code] { exit_code = plan_next(next->input, next->format == "json"); });
  add_flight(*plan, exit_code);
  add_import(*plan, exit_code);
}

}  // namespace anchord::cli
