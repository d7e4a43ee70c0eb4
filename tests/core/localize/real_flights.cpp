#include "tests/core/localize/real_flights.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "api/formats/csv_table.hpp"
#include "api/formats/flight_folder.hpp"
#include "api/formats/flight_json.hpp"
#include "core/geo/enu.hpp"
#include "tests/paths.hpp"

namespace anchord::testing {
namespace {

namespace fs = std::filesystem;

// 95 % of chi-square with two and three degrees of freedom.
constexpr double k_two = 5.991, k_three = 7.815;

struct Truth {
  Eigen::Vector3d at_m;
  bool flat{false};
};

/// anchors_truth.csv beside a flight; only tests open it.
std::map<NetworkId, Truth> read_truth(const fs::path& folder, const std::optional<Wgs84>& origin) {
  std::map<NetworkId, Truth> truth;
  auto table = CsvTable::open(folder, "anchors_truth");
  if (!table) return truth;
  CsvTable& t = table.value();
  const auto value = [&](const char* column) { return t.number(t.column(column).value()).value(); };
  const auto id = t.column("anchor_id").value();
  while (t.next().value()) {
    Truth one;
    if (origin) {
      const Wgs84 at{value("lat_deg"), value("lon_deg"), origin->height_m};
      one = {EnuFrame(*origin).enu_from_wgs84(at).m, true};
    } else {
      one.at_m = {value("x_m"), value("y_m"), value("z_m")};
    }
    truth[network_id_of(t.text(id))] = one;
  }
  return truth;
}

FlightOptions options_of(Variant variant) {
  FlightOptions options;
  if (variant == Variant::single || variant == Variant::profile) return options;
  options.loss = variant == Variant::plain ? Loss::none : Loss::tukey;
  options.fixed_bias_m = 0.0;
  options.delay_prior_m = options.curve_prior_m = options.lag_prior_s = options.lever_prior_m = 1e-5;
  return options;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

const char* word(Variant variant) {
  switch (variant) {
    case Variant::plain:
      return "plain";
    case Variant::robust:
      return "robust";
    case Variant::single:
      return "single";
    case Variant::profile:
      return "profile";
  }
  return "";
}

double AnchorError::ratio() const {
  const double claimed_m = flat ? solution.estimate.h95_m : claimed_3d_m;
  return claimed_m / std::max(error_m(), 1e-3);
}

double AnchorError::sigma_ratio() const { return claimed_sigma_m / std::max(error_m(), 1e-3); }

FlightSet read_set(const std::string& name) {
  FlightSet set;
  set.name = name;
  for (const auto& entry : fs::directory_iterator(fs::path(ANCHORD_SHARED_DATA) / name)) {
    if (fs::exists(entry.path() / "flight.json")) set.folders.push_back(entry.path());
  }
  std::ranges::sort(set.folders);
  for (const auto& folder : set.folders) set.flights.push_back(read_flight_folder(folder).value());
  return set;
}

std::vector<FlightSolution> solve_set(const FlightSet& set, Variant variant) {
  const FlightOptions options = options_of(variant);
  std::vector<const FlightData*> pointers;
  std::vector<FlightSolution> solutions;
  for (const auto& flight : set.flights) pointers.push_back(&flight);
  if (variant == Variant::profile) return solve_flights(pointers, options).value();
  for (const auto& flight : set.flights) solutions.push_back(solve_flight(flight, options).value());
  return solutions;
}

std::vector<AnchorError> assess(const FlightSet& set, std::size_t index, const FlightSolution& solution) {
  const auto truth = read_truth(set.folders[index], solution.origin);
  std::vector<AnchorError> all;
  for (const auto& anchor : solution.anchors) {
    const auto known = truth.find(anchor.estimate.anchor);
    if (known == truth.end()) continue;
    AnchorError one;
    one.flight = solution.name;
    one.solution = anchor;
    one.flat = known->second.flat;
    if (const auto& best = anchor.estimate.best) {
      const Eigen::Vector3d off = best->position.m - known->second.at_m;
      const Eigen::Matrix3d& c = best->covariance_m2;
      one.error_h_m = off.head<2>().norm();
      one.error_3d_m = off.norm();
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(c);
      one.claimed_3d_m = std::sqrt(k_three * axes.eigenvalues().maxCoeff());
      one.claimed_sigma_m = std::sqrt(one.flat ? c.topLeftCorner<2, 2>().trace() : c.trace());
      one.inside = one.flat ? off.head<2>().dot(c.topLeftCorner<2, 2>().inverse() * off.head<2>()) < k_two
                            : off.dot(c.inverse() * off) < k_three;
    }
    all.push_back(std::move(one));
  }
  return all;
}

Summary summary(const std::vector<AnchorError>& anchors) {
  Summary sum;
  std::vector<double> h95_m, ratios, sigma_ratios;
  for (const auto& one : anchors) {
    if (!one.answered()) {
      ++sum.undetermined;
      continue;
    }
    ++sum.n;
    sum.inside += one.inside ? 1 : 0;
    sum.mean_h_m += one.error_h_m;
    sum.mean_m += one.error_m();
    sum.max_m = std::max(sum.max_m, one.error_m());
    h95_m.push_back(one.solution.estimate.h95_m);
    ratios.push_back(one.ratio());
    sigma_ratios.push_back(one.sigma_ratio());
    const bool accepted = one.solution.estimate.acceptable();
    sum.acceptable += accepted ? 1 : 0;
    sum.acceptable_outside += accepted && !one.inside ? 1 : 0;
  }
  if (sum.n > 0) {
    sum.mean_h_m /= sum.n;
    sum.mean_m /= sum.n;
  }
  sum.median_h95_m = median(h95_m);
  sum.median_ratio = median(ratios);
  sum.median_sigma_ratio = median(sigma_ratios);
  return sum;
}

}  // namespace anchord::testing
