#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

/// How good a classifier or a correction is (6.2.3). Positive is LOS throughout, so FPR is the share of NLOS
/// called LOS: the mistake to avoid (half of the literature has it the other way round).
namespace anchord::ml {

struct Confusion {
  double tp{};  ///< LOS called LOS
  double fp{};  ///< NLOS called LOS
  double fn{};  ///< LOS called NLOS
  double tn{};  ///< NLOS called NLOS

  void count(bool is_los, bool called_los, double weight = 1);
  double total() const { return tp + fp + fn + tn; }
  double accuracy() const;           ///< eq 6.5
  double balanced_accuracy() const;  ///< mean of both classes' hit rates
  double fpr() const;                ///< eq 6.6: fp / (fp + tn)
  double fnr() const;                ///< fn / (fn + tp)
};

Confusion confusion_at(std::span<const double> p_los, std::span<const std::uint8_t> los, double threshold);

/// Mean of (p - y)^2.
double brier(std::span<const double> p_los, std::span<const std::uint8_t> los,
             std::span<const double> weight = {});
/// Mean of -ln p of what was true; p clipped to 1e-6.
double log_loss(std::span<const double> p_los, std::span<const std::uint8_t> los,
                std::span<const double> weight = {});

struct RocPoint {
  double threshold{};
  double fpr{};
  double tpr{};
};
/// From (0, 0) to (1, 1), one point per distinct probability, thresholds falling; "LOS" is p >= threshold.
std::vector<RocPoint> roc(std::span<const double> p_los, std::span<const std::uint8_t> los);
double area_under(std::span<const RocPoint> curve);

/// Errors y - h(x), metres.
struct ErrorStats {
  std::size_t n{};
  double mae_m{};   ///< eq 6.7
  double mse_m2{};  ///< eq 6.8
};
ErrorStats error_stats(std::span<const double> error_m);

/// Share saved against the uncorrected: 0.64 is 64 % (eq 6.9, 6.10). Negative: the correction harms. 0 where
/// nothing was wrong.
double improvement(double uncorrected, double corrected);

struct CdfPoint {
  double value_m{};
  double share{};
};
/// Of |value|, at up to `points` evenly spread shares.
std::vector<CdfPoint> cdf_of_magnitude(std::span<const double> value_m, std::size_t points = 101);

}  // namespace anchord::ml
