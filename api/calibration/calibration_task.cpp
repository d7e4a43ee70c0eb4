#include "api/calibration/calibration_task.hpp"

#include <algorithm>
#include <utility>

#include "api/calibration/kit_profiles.hpp"
#include "core/localize/convergence.hpp"
#include "core/localize/flight_copies.hpp"

namespace anchord::api {
namespace {

/// Flights under the keys by which a profile tells its factors apart, while this lives. They are too large to
/// be copied for that.
class UnderKeys {
 public:
  UnderKeys(std::vector<FlightData>& flights, const std::vector<std::size_t>& members) {
    for (const std::size_t i : members) {
      FlightData& flight = flights[i];
      renamed_.push_back({&flight, flight.mission.name});
      flight.mission.name = KitProfiles::flight_key(flight.mission);
      pointers_.push_back(&flight);
    }
  }
  ~UnderKeys() {
    for (auto& [flight, name] : renamed_) flight->mission.name = std::move(name);
  }
  UnderKeys(const UnderKeys&) = delete;
  UnderKeys& operator=(const UnderKeys&) = delete;

  const std::vector<const FlightData*>& pointers() const { return pointers_; }

 private:
  std::vector<std::pair<FlightData*, std::string>> renamed_;
  std::vector<const FlightData*> pointers_;
};

bool believed(const FlightSolution& solution) {
  return std::ranges::any_of(solution.anchors,
                             [](const AnchorSolution& a) { return a.estimate.verdict == Verdict::ok; });
}

/// Flights by the place they have in the task, and what was made of them.
struct Solved {
  std::vector<FlightData>& flights;
  std::vector<std::optional<FlightSolution>> solutions{};
  std::vector<KitProfile> learned{};
  Convergence course{};

  std::vector<std::size_t> of_kit(const std::string& kit) const {
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < flights.size(); ++i)
      if (flights[i].mission.kit == kit) out.push_back(i);
    return out;
  }
};

/// Which of the task's wishes hold for one run over all kits.
struct Wish {
  bool use_profile;
  int iterations;
};

/// All flights of one kit together, with what the kit's stored profile says about them.
Result<void> solve_kit(const CalibrationTask& task, const CalibrationTask::Kit& kit, const Wish& wish,
                       Solved& solved) {
  FlightOptions of_kit = task.options;
  const bool stored = wish.use_profile && !kit.name.empty();
  if (stored) of_kit.profile = kit.profile;
  of_kit.priors = kit.priors;
  const auto members = solved.of_kit(kit.name);
  const UnderKeys keyed(solved.flights, members);
  KitProfile learned;
  BOOST_OUTCOME_TRY(auto answers, solve_flights(keyed.pointers(), of_kit, &learned));
  for (std::size_t k = 0; k < members.size(); ++k) {
    if (!believed(answers[k]))
      std::erase_if(learned.factors,
                    [&](const ProfileFactor& f) { return f.flight == keyed.pointers()[k]->mission.name; });
    solved.solutions[members[k]] = std::move(answers[k]);
  }
  if (stored && teaches(task.options)) solved.learned.push_back(std::move(learned));
  if (wish.iterations > 0 && !members.empty() && members.front() < task.n_answered && solved.course.empty()) {
    BOOST_OUTCOME_TRY(solved.course, convergence_of(*keyed.pointers().front(), of_kit, wish.iterations));
  }
  return boost::outcome_v2::success();
}

Result<void> solve_kits(const CalibrationTask& task, const Wish& wish, Solved& solved) {
  solved.solutions.resize(solved.flights.size());
  for (const auto& kit : task.kits) {
    BOOST_OUTCOME_TRYV(solve_kit(task, kit, wish, solved));
  }
  return boost::outcome_v2::success();
}

/// `raw`: the same without the models, where it is compared or their worth is asked for; else it stays empty.
Result<void> solve_by_models(CalibrationTask& task, const CalibrationProgress& progress, Solved& solved,
                             Solved& raw) {
  std::size_t n_said = 0;
  for (const auto& report : task.models) n_said += report.n_corrected + report.n_believed;
  Wish wish{profiles_used(task.use_profile, task.models), task.iterations};
  if (n_said > 0 && (task.compare_uncorrected || task.ask_worth)) {
    for (const auto& flight : solved.flights) raw.flights.push_back(as_received(flight));
  }
  BOOST_OUTCOME_TRYV(solve_kits(task, wish, solved));
  if (raw.flights.empty()) return boost::outcome_v2::success();
  progress(0.6, "without the models");
  // What corrected ranges teach is no bias of the kit.
  BOOST_OUTCOME_TRYV(solve_kits(task, {task.use_profile, 0}, raw));
  if (task.ask_worth &&
      leave_out_worthless(task.models, solved.flights, raw.flights, solved.solutions, raw.solutions)) {
    progress(0.75, "without models that show no worth");
    wish.use_profile = profiles_used(task.use_profile, task.models);
    solved.course.clear();
    BOOST_OUTCOME_TRYV(solve_kits(task, wish, solved));
  }
  solved.learned = std::move(raw.learned);
  return boost::outcome_v2::success();
}

FlightAnswer answer_of(const FlightData& flight, const FlightSolution& solution,
                       const std::optional<Wgs84>& origin) {
  FlightAnswer out;
  out.evidence = evidence_of(flight, solution, origin);
  out.fixes_refused = solution.fixes_refused;
  for (const auto& anchor : solution.anchors) out.anchors.push_back({anchor.estimate, anchor.budget});
  return out;
}

/// Among the flights that are answered: what others only teach about a kit is in no anchor.
std::vector<std::optional<std::size_t>> copies_of(const CalibrationTask& task) {
  std::vector<const FlightData*> answered;
  for (std::size_t i = 0; i < task.n_answered; ++i) answered.push_back(&task.flights[i]);
  return flight_copies(answered);
}

}  // namespace

bool teaches(const FlightOptions& options) {
  const FlightOptions usual;
  return options.loss == usual.loss && options.weights == usual.weights && options.dims == usual.dims &&
         options.min_fix == usual.min_fix && options.mad_factor == usual.mad_factor && !options.fixed_bias_m;
}

bool profiles_used(bool wanted, const std::vector<FlightModelsReport>& models) {
  return wanted && std::ranges::none_of(models, [](const auto& m) { return m.used && m.n_corrected > 0; });
}

Result<CalibrationAnswer> solve_calibration(CalibrationTask& task, const CalibrationProgress& progress) {
  progress(0, std::to_string(task.flights.size()) + " flights");
  const auto copies = copies_of(task);
  Solved solved{task.flights};
  std::vector<FlightData> received;
  Solved raw{received};
  BOOST_OUTCOME_TRYV(solve_by_models(task, progress, solved, raw));
  if (task.options.canceled && task.options.canceled()) return make_error(Errc::canceled, "canceled");
  // Positions in local metres have no origin, whatever the frame of a single track.
  const auto origin =
      task.flights.front().mission.frame == TrackFrame::wgs84 ? task.options.origin : std::nullopt;
  CalibrationAnswer out;
  for (std::size_t i = 0; i < task.n_answered; ++i) {
    FlightAnswer& flight = out.flights.emplace_back(answer_of(task.flights[i], *solved.solutions[i], origin));
    flight.copy_of = copies[i];
    // Those of one kit were solved together, and say it themselves.
    if (copies[i] && task.flights[i].mission.kit != task.flights[*copies[i]].mission.kit)
      flight.evidence.notes.push_back(copy_note(task.flights[*copies[i]].mission.name));
    if (raw.flights.empty() || !task.compare_uncorrected) continue;
    for (const auto& anchor : raw.solutions[i]->anchors) flight.uncorrected.push_back(anchor.estimate);
  }
  out.learned = std::move(solved.learned);
  out.models = std::move(task.models);
  out.course = std::move(solved.course);
  return out;
}

}  // namespace anchord::api
