#include "core/localize/prior_conflict.hpp"

#include <cmath>
#include <cstdio>
#include <numbers>

namespace anchord {
namespace {

constexpr double k_contradicted = 3.0;  // sigmas; from there on side_priors.cpp doubts a prior

void add(std::string& text, const char* format, double prior, double found, double sigmas) {
  char sentence[240];
  std::snprintf(sentence, sizeof sentence, format, prior, found, sigmas);
  text += (text.empty() ? "" : "; ") + std::string(sentence);
}

double turned_deg(double angle_rad) {
  const double deg = std::fmod(angle_rad * 180 / std::numbers::pi, 360.0);
  return deg < 0 ? deg + 360 : deg;
}

}  // namespace

std::string prior_conflict(const AnchorPriors& priors, const Eigen::Vector3d& place_m, Dims dims) {
  std::string text;
  if (const auto& b = priors.bearing) {
    const Eigen::Vector2d way = (place_m - b->tag_m).head<2>();
    const double found_rad = std::atan2(way.x(), way.y());
    const double sigmas =
        std::abs(std::remainder(b->bearing_rad - found_rad, 2 * std::numbers::pi)) / b->sigma_rad;
    // Right above there is no bearing to speak of.
    if (sigmas > k_contradicted && way.norm() > 1.0)
      add(text,
          "the bearing %.0f degrees (of a turn, or given) disagrees with the ranges, %.0f degrees from there "
          "(%.1f sigma): the ranges are used; a reflection may have changed the bearing",
          turned_deg(b->bearing_rad), turned_deg(found_rad), sigmas);
  }
  if (const auto& h = priors.height; h && dims == Dims::three) {
    const double sigmas = std::abs(h->up_m - place_m.z()) / h->sigma_m;
    if (sigmas > k_contradicted)
      add(text,
          "the height %.2f m above the origin (of a height search, or given) disagrees with the ranges, %.2f "
          "m "
          "(%.1f sigma): the ranges are used; the peak may be a reflection",
          h->up_m, place_m.z(), sigmas);
  }
  return text;
}

void name_prior_conflict(const AnchorPriors& priors, Dims dims, Estimate& estimate) {
  if (!estimate.best) return;
  const std::string text = prior_conflict(priors, estimate.best->position.m, dims);
  if (!text.empty()) estimate.reason += (estimate.reason.empty() ? "" : "; ") + text;
}

}  // namespace anchord
