#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace anchord::ml {

struct BiasDensity;

/// Density of the range bias of a link of which only P(LOS) is known.
///
/// e = bias - b0(x);  f(e) = .99 [p N(e; m0, s0) + (1 - p) EMG(e; m1, s1, tau)] + .01 / 10 m
/// with p = P(LOS), EMG a Gaussian plus an exponential delay of mean tau (a blocked path arrives late, never
/// early), and ln tau = a0 + a1 z(X) + a2 z(D) over the free-space level X and the first-path difference D,
/// each z clipped to +-2. b0 is the bias both classes share (antenna delay, level): k + kappa (g(x) - k). The
/// correction is a quantile of the whole, not the mean: a doubtful range is moved little.
struct BiasMixture {
  struct Shared {
    double centre_m{};                                          ///< k
    double kappa{};                                             ///< 0: the constant alone
    std::vector<std::size_t> features{};                        ///< indices into the model's features
    std::vector<double> mean{}, sd{}, low{}, high{}, weight{};  ///< g: clip to low..high, standardise, weigh
    double offset_m{};
  };
  struct TailTerm {
    std::size_t feature{};
    double mean{}, sd{1}, weight{};
  };
  Shared shared{};
  double m0_m{}, s0_m{0.1}, m1_m{}, s1_m{0.1};
  double log_tau{};              ///< a0, tau in metres
  std::vector<TailTerm> tail{};  ///< a1, a2
  double quantile{0.5};          ///< which quantile corrects
  double gain{1};                ///< share of the correction that is applied
  struct Seen {
    double min_m{}, max_m{};
  };
  std::optional<Seen> seen{};  ///< biases of the training rows; absent: a model of an older program

  /// More than the whole span of what was seen beyond it: a tail that ran away.
  bool far_beyond_seen(double bias_m) const {
    const double span_m = seen ? seen->max_m - seen->min_m : 0;
    return seen && (bias_m > seen->max_m + span_m || bias_m < seen->min_m - span_m);
  }

  /// What to subtract from the measured range: gain times the quantile.
  double correction_m(const BiasDensity& density) const;

  double shared_m(std::span<const double> features) const;
  double tau_m(std::span<const double> features) const;
};

/// The mixture of one range: numbers alone.
struct BiasDensity {
  double p_los{}, shared_m{}, m0_m{}, s0_m{}, m1_m{}, s1_m{}, tau_m{};

  double log_density(double bias_m) const;
  double cdf(double bias_m) const;
  double quantile(double q) const;  ///< bisection to 0.1 mm
  double mean_m() const;            ///< without the uniform part
  double sigma_m() const;           ///< sd without the uniform part
};

BiasDensity density_of(const BiasMixture& mixture, double p_los, std::span<const double> features);

/// scaled complementary error function exp(x^2) erfc(x), relative error below 1e-12 for x > -5.
double erfcx(double x);
/// ln of the exponentially modified Gaussian's density, and its distribution function.
double emg_log_density(double e, double mean, double sigma, double tau);
double emg_cdf(double e, double mean, double sigma, double tau);

}  // namespace anchord::ml
