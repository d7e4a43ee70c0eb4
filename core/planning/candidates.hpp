#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/planning/bounds.hpp"
#include "core/planning/grid.hpp"

namespace anchord::planning {

struct CandidateValue {
  Eigen::Vector3d point_m{0, 0, 0};
  double value{};   ///< of the rule, combined; +infinity where singular
  double score{};   ///< what was minimised: value, or minus the gain per second
  double p_nlos{};  ///< expected, mean over anchors
  double flight_s{};
  std::optional<Refusal> refused{};  ///< value is still shown, but the point cannot be chosen
};

/// Why each candidate may not be flown to, a byte each.
class Refusals {
 public:
  explicit Refusals(std::size_t size = 0) : of_(size, 0) {}
  bool any(std::size_t i) const { return of_[i] != 0; }
  std::optional<Refusal> operator[](std::size_t i) const {
    if (of_[i] == 0) return std::nullopt;
    return static_cast<Refusal>(of_[i] - 1);
  }
  /// The first reason stays.
  void refuse(std::size_t i, Refusal why) {
    if (of_[i] == 0) of_[i] = static_cast<std::uint8_t>(static_cast<unsigned>(why) + 1);
  }
  std::size_t size() const { return of_.size(); }

 private:
  std::vector<std::uint8_t> of_;  ///< 0: may be flown to, else the reason + 1
};

/// All candidates of a decision, each number of them side by side: what a decision over a large grid costs is
/// mostly the memory that it fills.
struct Candidates {
  Grid grid;
  std::vector<std::vector<double>> of_anchor;  ///< the rule's value for each anchor alone
  std::vector<double> value;                   ///< combined
  std::vector<double> scored;                  ///< empty: the value itself
  std::vector<double> expected_nlos;           ///< empty: no wall is known, 0 everywhere
  Refusals refused;
  Eigen::Vector3d from_m{0, 0, 0};
  double speed_mps{1}, dwell_s{};

  std::size_t size() const { return value.size(); }
  bool empty() const { return value.empty(); }
  double score(std::size_t i) const { return scored.empty() ? value[i] : scored[i]; }
  double flight_s(std::size_t i) const { return (grid.at(i) - from_m).norm() / speed_mps + dwell_s; }
  CandidateValue operator[](std::size_t i) const {
    return {grid.at(i),  value[i],  score(i), expected_nlos.empty() ? 0.0 : expected_nlos[i],
            flight_s(i), refused[i]};
  }

  class Iterator {
   public:
    Iterator(const Candidates& of, std::size_t i) : of_(&of), i_(i) {}
    CandidateValue operator*() const { return (*of_)[i_]; }
    Iterator& operator++() {
      ++i_;
      return *this;
    }
    bool operator==(const Iterator&) const = default;

   private:
    const Candidates* of_;
    std::size_t i_;
  };
  Iterator begin() const { return {*this, 0}; }
  Iterator end() const { return {*this, size()}; }
};

}  // namespace anchord::planning
