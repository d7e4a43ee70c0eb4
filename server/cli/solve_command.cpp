#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

#include "api/calibration/kit_profile_json.hpp"
#include "api/calibration/priors_json.hpp"
#include "api/calibration/solve_output.hpp"
#include "api/formats/flight_folder.hpp"
#include "api/learning/flight_models.hpp"
#include "core/base/text.hpp"
#include "core/base/whole_file.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/kit_prior.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/flight_source.hpp"
#include "server/cli/learning_data.hpp"
#include "server/cli/solve_report.hpp"
#include "server/cli/words.hpp"

namespace anchord::cli {
namespace {

constexpr int k_unusable = 2;

/// What the command line of solve and profile holds.
struct Arguments {
  std::vector<std::string> folders;
  SolveFormat format{SolveFormat::table};
  Method solver{Method::gauss_newton};
  Weights weights{Weights::inverse_variance};
  Loss loss{Loss::tukey};
  FixClass min_fix{FixClass::rtk_fixed};
  int dims{3};
  std::optional<double> bias_m, height_m, height_sigma_m, max_gap_s, lever_arm_sigma_m;
  std::vector<double> height_prior;
  double max_correction_age_s{TrackLimits{}.max_correction_age_s};
  std::string profile, out, priors;
  std::vector<std::string> models;
  bool likelihood{true}, ask_worth{true};
  AnchorMethod method{AnchorMethod::joint};
  SolveReportOptions report;
  ForeignSource foreign;
};

int complain(const Error& error) {
  std::fprintf(stderr, "anchord: %s\n", printable(error.message).c_str());
  return k_unusable;
}

Result<KitProfile> read_profile(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return make_error(Errc::not_found, file + ": cannot be opened");
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  auto profile = parse_kit_profile(text);
  if (!profile) return make_error(profile.error().code, file + ": " + profile.error().message);
  return profile;
}

Result<void> add_priors(const std::string& file, FlightOptions& options) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return make_error(Errc::not_found, file + ": cannot be opened");
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  nlohmann::json json;
  std::vector<api::FieldError> errors;
  if (auto fault = api::parse_json(text, json)) {
    errors.push_back(*std::move(fault));
  } else {
    api::read_priors(json, "", options, errors);
  }
  if (errors.empty()) return boost::outcome_v2::success();
  return make_error(Errc::invalid_argument,
                    file + ": " + errors.front().pointer + ": " + errors.front().detail);
}

Result<FlightOptions> options_of(const Arguments& a) {
  FlightOptions options;
  options.dims = a.dims == 2 ? Dims::two : Dims::three;
  options.method = a.solver;
  options.weights = a.weights;
  options.loss = a.loss;
  options.min_fix = a.min_fix;
  options.fixed_bias_m = a.bias_m;
  options.track.max_correction_age_s = a.max_correction_age_s;
  options.anchor_height_m = a.height_m;
  if (a.height_sigma_m) options.anchor_height_sigma_m = *a.height_sigma_m;
  options.max_gap_s = a.max_gap_s;
  options.lever_arm_sigma_m = a.lever_arm_sigma_m;
  if (a.height_prior.size() == 2) options.height_prior = {a.height_prior[0], a.height_prior[1]};
  if (!a.profile.empty()) {
    BOOST_OUTCOME_TRY(options.profile, read_profile(a.profile));
  }
  if (!a.priors.empty()) {
    BOOST_OUTCOME_TRYV(add_priors(a.priors, options));
  }
  BOOST_OUTCOME_TRY(options.check());
  return options;
}

Result<std::vector<FlightData>> read_all(const Arguments& a) {
  std::vector<FlightData> flights;
  if (a.folders.empty() && !a.foreign.given())
    return make_error(Errc::invalid_argument, "give a flight folder, or --track and --ranges");
  if (a.foreign.given()) {
    BOOST_OUTCOME_TRY(auto flight, read_foreign_source(a.foreign));
    std::fprintf(stderr, "%s: %zu positions, %zu ranges\n", printable(flight.mission.name).c_str(),
                 flight.fixes.size(), flight.ranges.size());
    for (const auto& note : flight.notes) std::fprintf(stderr, "note: %s\n", printable(note).c_str());
    flights.push_back(std::move(flight));
  }
  for (const auto& folder : a.folders) {
    std::fprintf(stderr, "reading %s\n", folder.c_str());
    BOOST_OUTCOME_TRY(auto flight, read_flight_folder(folder));
    std::fprintf(stderr, "  %zu positions, %zu ranges\n", flight.fixes.size(), flight.ranges.size());
    leave_out_excluded(flight);
    flights.push_back(std::move(flight));
  }
  return flights;
}

/// What the service does with promoted models, with the artifacts named; of each flight what they did.
Result<std::vector<api::FlightModelsReport>> apply_models(const Arguments& a,
                                                          std::vector<FlightData>& flights) {
  std::vector<api::FlightModelsReport> reports;
  if (a.models.empty()) return reports;
  if (!a.profile.empty())
    return make_error(Errc::invalid_argument,
                      "--models and --profile: a kit profile contains the bias of raw ranges, which would be "
                      "subtracted twice from corrected ones");
  std::vector<ml::Model> models;
  for (const auto& file : a.models) {
    BOOST_OUTCOME_TRY(auto model, read_model_file(file));
    models.push_back(std::move(model));
  }
  BOOST_OUTCOME_TRY(const auto together, api::models_together(std::move(models), ml::Correction::weighted));
  for (auto& flight : flights) {
    reports.push_back(api::correct_flight(together, flight, a.likelihood));
    const auto& report = reports.back();
    std::fprintf(stderr, "  %s: models corrected %zu of %zu ranges, by %.3f m on average, and weighted %zu\n",
                 flight.mission.name.c_str(), report.n_corrected, report.n_ranges, report.mean_correction_m,
                 report.n_believed);
    if (report.n_corrected + report.n_believed == 0)
      return make_error(Errc::invalid_argument,
                        flight.mission.name + ": the models cannot predict its ranges: " + report.note);
  }
  return reports;
}

/// A profile of another kit would be left out in silence.
Result<void> check_profile_kit(const FlightOptions& options, const std::vector<FlightData>& flights) {
  if (!options.profile || options.profile->kit.empty()) return boost::outcome_v2::success();
  for (const auto& flight : flights) {
    if (flight.mission.kit == options.profile->kit) continue;
    return make_error(Errc::invalid_argument, "--profile is of kit '" + options.profile->kit + "', flight " +
                                                  flight.mission.name + " of kit '" + flight.mission.kit +
                                                  "': give the profile of that kit, or none");
  }
  return boost::outcome_v2::success();
}

bool leave_out_worthless(std::vector<api::FlightModelsReport>& models, std::vector<FlightData>& flights,
                         const std::vector<FlightData>& raw, const std::vector<FlightSolution>& with,
                         const std::vector<FlightSolution>& without) {
  using Maybe = std::vector<std::optional<FlightSolution>>;
  return api::leave_out_worthless(models, flights, raw, Maybe(with.begin(), with.end()),
                                  Maybe(without.begin(), without.end()));
}

std::vector<const FlightData*> pointers(const std::vector<FlightData>& flights) {
  std::vector<const FlightData*> all;
  for (const auto& flight : flights) all.push_back(&flight);
  return all;
}

int solve(const Arguments& a) {
  const auto options = options_of(a);
  if (!options) return complain(options.error());
  auto flights = read_all(a);
  if (!flights) return complain(flights.error());
  if (const auto fits = check_profile_kit(options.value(), flights.value()); !fits)
    return complain(fits.error());
  const std::vector<FlightData> raw = a.models.empty() ? std::vector<FlightData>{} : flights.value();
  auto models = apply_models(a, flights.value());
  if (!models) return complain(models.error());
  std::fprintf(stderr, "solving %zu flight%s\n", flights.value().size(),
               flights.value().size() == 1 ? "" : "s");
  auto solutions = solve_flights(pointers(flights.value()), options.value());
  if (!solutions) return complain(solutions.error());
  if (!models.value().empty() && a.ask_worth) {
    const auto without = solve_flights(pointers(raw), options.value());
    if (!without) return complain(without.error());
    if (leave_out_worthless(models.value(), flights.value(), raw, solutions.value(), without.value())) {
      solutions = solve_flights(pointers(flights.value()), options.value());
      if (!solutions) return complain(solutions.error());
    }
  }
  std::vector<SolvedFlight> solved;
  for (std::size_t i = 0; i < flights.value().size(); ++i) {
    solved.push_back({&flights.value()[i], &solutions.value()[i]});
    auto methods = compare_methods(flights.value()[i], options.value(), solutions.value()[i].origin);
    if (!methods) return complain(methods.error());
    solved.back().methods = std::move(methods).value();
    if (models.value().empty()) continue;
    solved.back().models = &models.value()[i];
    if (!models.value()[i].used)
      std::fprintf(stderr, "note: %s: %s\n", printable(flights.value()[i].mission.name).c_str(),
                   flights.value()[i].notes.back().c_str());
  }
  for (std::size_t i = 0; i < solved.size() && !a.report.file.empty(); ++i) {
    SolveReportOptions one = a.report;
    if (solved.size() > 1)
      one.file.replace_filename(one.file.stem().string() + "-" + std::to_string(i + 1) +
                                one.file.extension().string());
    std::fprintf(stderr, "writing %s\n", one.file.c_str());
    if (const auto written =
            write_solve_report(*solved[i].data, *solved[i].solution, solved[i].methods, options.value(), one);
        !written)
      return complain(written.error());
  }
  // The page compares; what is printed is the answer asked for.
  for (std::size_t i = 0; i < solved.size(); ++i)
    answer_by(a.method, solved[i].methods, solutions.value()[i]);
  const std::string text = solve_output(solved, a.format);
  std::fwrite(text.data(), 1, text.size(), stdout);
  if (std::fflush(stdout) != 0) return 1;
  int exit_code = 0;
  for (const auto& solution : solutions.value()) {
    if (solution.placed) continue;
    std::fprintf(stderr, "anchord: %s: %s\n", printable(solution.name).c_str(),
                 printable(solution.notes.front()).c_str());
    exit_code = k_unusable;
  }
  return exit_code;
}

int fit_profile(const Arguments& a) {
  const auto options = options_of(a);
  if (!options) return complain(options.error());
  const auto flights = read_all(a);
  if (!flights) return complain(flights.error());
  if (const auto fits = check_profile_kit(options.value(), flights.value()); !fits)
    return complain(fits.error());
  for (const auto& flight : flights.value()) {
    if (flight.mission.kit.empty() || flight.mission.kit != flights.value().front().mission.kit) {
      return complain(make_error(Errc::invalid_argument, "all flights must be of one kit: '" +
                                                             flight.mission.kit + "' and '" +
                                                             flights.value().front().mission.kit + "'"));
    }
  }
  KitProfile profile;
  const auto solutions = solve_flights(pointers(flights.value()), options.value(), &profile);
  if (!solutions) return complain(solutions.error());
  for (const auto& solution : solutions.value()) {
    for (const auto& note : solution.notes)
      std::fprintf(stderr, "note: %s: %s\n", printable(solution.name).c_str(), printable(note).c_str());
    if (!solution.placed)
      return complain(make_error(Errc::too_few_observations, solution.name + ": " + solution.notes.front()));
  }
  // It may be the profile of flights before, which are not at hand any more.
  if (const auto written = write_whole(a.out, kit_profile_json(profile)); !written)
    return failed("anchord profile", written.error().message);
  std::fprintf(stderr, "profile of kit %s from %zu flights in %s\n", printable(profile.kit).c_str(),
               profile.factors.size(), a.out.c_str());
  return 0;
}

int show_profile(const std::string& file) {
  const auto profile = read_profile(file);
  if (!profile) return complain(profile.error());
  const FlightOptions options;
  const BiasGate gate = bias_gate(profile.value().factors, options);
  const SharedPrior prior = profile_prior(profile.value().factors, gate, options);
  const auto sigma = prior_sigmas(prior);
  std::printf("kit %s, %zu flights\n", printable(profile.value().kit).c_str(),
              profile.value().factors.size());
  for (const auto& factor : profile.value().factors) std::printf("  %s\n", printable(factor.flight).c_str());
  std::printf("bias %.3f m (sigma %.3f), %s (z %.1f, limit %.1f)\n", gate.bias_m, gate.sigma_m,
              !gate.known       ? "not determined"
              : gate.calibrated ? "treated as calibrated"
                                : "not calibrated",
              gate.z, options.bias_gate_z);
  std::printf(
      "prior of the next flight: bias %.3f m (%.3f), range curve %.3f m per e-fold (%.3f), lag %.3f s "
      "(%.3f), antenna up "
      "%.3f m (%.3f)\n",
      prior.mean[0], sigma[0], prior.mean[1], sigma[1], prior.mean[2], sigma[2], prior.mean[3], sigma[3]);
  return 0;
}

void add_options(CLI::App& command, Arguments& a) {
  command.add_option("flights", a.folders,
                     "Flight folders (docs/formats.md); flights of one kit share its calibration");
  add_word(command, "--solver", a.solver, k_solver_words, "Method of the minimisation");
  add_word(command, "--weights", a.weights, k_weights_words,
           "inverse_variance, or dissertation: as eq 7.11 is printed");
  add_word(command, "--loss", a.loss, k_loss_words, "Weight of large residuals (loss)");
  command.add_option("--dims", a.dims, "3, or 2 with the height held")->check(CLI::IsMember({2, 3}));
  auto* height = command.add_option(
      "--height", a.height_m,
      "With --dims 2: height of all anchors in metres, ellipsoidal where the track is global "
      "(the heights of the table), else z; without it none is acceptable");
  command
      .add_option("--height-sigma", a.height_sigma_m,
                  "One sigma of that height in metres: every region includes it [0.1]")
      ->needs(height)
      ->check(CLI::Range(0.001, 100.0));
  command
      .add_option("--height-prior", a.height_prior,
                  "HEIGHT,SIGMA in metres: approximate height of all anchors, such as that of their poles; "
                  "reference as for --height")
      ->delimiter(',')
      ->expected(2);
  command.add_option("--max-gap", a.max_gap_s,
                     "Longest interval of the track in seconds in which a range is placed [as long as the "
                     "interpolation error is below 0.5 m]");
  add_word(command, "--min-fix", a.min_fix, k_fix_words, "Lowest fix class of the track that is used");
  command
      .add_option("--max-correction-age", a.max_correction_age_s,
                  "Seconds; RTK fixed with older corrections counts as float")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command.add_option("--bias", a.bias_m,
                     "Known range bias of the kit in metres, used instead of an estimate");
  command
      .add_option(
          "--lever-arm-sigma", a.lever_arm_sigma_m,
          "One sigma of the measured lever arm, forward and left, in metres: the regions include it, and a "
          "flight with one heading is not withheld because of it [lever_arm_sigma_m of flight.json]")
      ->check(CLI::Range(k_least_lever_arm_sigma_m, k_most_lever_arm_sigma_m));
  command.add_option("--profile", a.profile, "Kit profile of earlier flights (anchord profile fit)");
}

}  // namespace

void add_solve_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("solve", "Find the anchors of recorded flights, without a server");
  auto arguments = std::make_shared<Arguments>();
  add_options(*command, *arguments);
  add_foreign_source(*command, arguments->foreign);
  auto* priors = command->add_option(
      "--priors", arguments->priors,
      "JSON: outline, bearings, heights, RSS: priors that separate an anchor from its mirror "
      "(docs/formats.md)");
  command->add_option("--clues", arguments->priors, "Deprecated name of --priors")->excludes(priors);
  auto* models =
      command->add_option("--models", arguments->models,
                          "Model artifacts (anchord train) that correct and weight the ranges, one per task");
  add_word(
      *command, "--likelihood", arguments->likelihood, api::k_likelihood_words,
      "With --models: one_sided, weight by the likelihood of the models, or loss, use only their corrections")
      ->needs(models);
  add_word(*command, "--worth", arguments->ask_worth, api::k_worth_words,
           "With --models: shown, do not use them for a flight that they do not explain better than its "
           "uncorrected ranges, or ignored")
      ->needs(models);
  add_word(*command, "--method", arguments->method, k_anchor_method_words,
           "joint, or for comparison linear (eq 7.2 to 7.5) or wls (eq 7.10), which are never acceptable; "
           "the report and the JSON contain all three");
  add_word(*command, "--format", arguments->format, k_solve_format_words, "On standard output");
  auto* report = command->add_option(
      "--report", arguments->report.file,
      "Also write a printable report to this HTML file; with several flights to FILE-1.html, ...");
  command
      ->add_option("--truth", arguments->report.truth,
                   "For the report: anchors_truth.csv with surveyed positions to compare with")
      ->needs(report);
  command
      ->add_option(
          "--iterations", arguments->report.iterations,
          "For the report: number of growing parts of the flight to solve for the error curves; 0: none")
      ->check(CLI::Range(0, 50))
      ->needs(report);
  command->callback([arguments, &exit_code] { exit_code = solve(*arguments); });
}

void add_profile_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("profile", "Calibration of a kit, kept from flight to flight");
  command->require_subcommand(1);
  auto arguments = std::make_shared<Arguments>();
  auto* fit = command->add_subcommand(
      "fit", "Estimate bias, range curve, lag and antenna offset from flights of one kit");
  add_options(*fit, *arguments);
  fit->add_option("--out", arguments->out, "File to write")->required();
  fit->callback([arguments, &exit_code] { exit_code = fit_profile(*arguments); });
  auto* show =
      command->add_subcommand("show", "Print a profile and the prior that it gives to the next flight");
  auto file = std::make_shared<std::string>();
  show->add_option("file", *file, "Profile written by profile fit")->required();
  show->callback([file, &exit_code] { exit_code = show_profile(*file); });
}

}  // namespace anchord::cli
