#include "api/learning/range_features.hpp"

#include <cmath>
#include <numbers>

namespace anchord::api {
namespace {

void take_cir(const std::optional<Cir>& cir, bool whole_record, nlos::DiagnosticSample& s) {
  if (!cir) return;
  nlos::CirOptions options;
  options.whole_record = whole_record;
  if (cir->dt_ps > 0) options.tap_ns = cir->dt_ps * 1e-3;
  // STD_NOISE is of |h|, whose variance in noise (Rayleigh) is 1 - pi / 4 of its mean square.
  if (s.std_noise) options.noise_rms = *s.std_noise / std::sqrt(1 - std::numbers::pi / 4);
  s.cir = nlos::cir_shape(std::span<const std::int16_t>(cir->re_im), cir->first_path_idx, options);
  if (!s.preamble_count) s.preamble_count = cir->preamble_count;
}

}  // namespace

nlos::FeatureVector features_of(const Range& range, bool whole_record) {
  nlos::DiagnosticSample s;
  s.range_m = range.distance_m;
  s.rx_dbm = range.rx_dbm ? range.rx_dbm : range.rss_dbm;
  s.fp_dbm = range.fp_dbm;
  s.std_noise = range.std_noise;
  // Its heading is a compass's; a campaign's heading_deg is the orientation a person noted (5.2).
  take_cir(range.cir, whole_record, s);
  return nlos::compute_features(s);
}

nlos::FeatureVector features_of(const CampaignSample& x, const GroundTruth& truth) {
  nlos::DiagnosticSample s;
  s.range_m = x.range_m;
  s.rx_dbm = x.rx_dbm;
  s.fp_dbm = x.fp_dbm;
  s.fp_amp1 = x.fp_amp1;
  s.fp_amp2 = x.fp_amp2;
  s.fp_amp3 = x.fp_amp3;
  s.cir_power = x.cir_power;
  s.preamble_count = x.preamble_count;
  s.std_noise = x.std_noise;
  s.max_noise = x.max_noise;
  s.fp_index = x.fp_index;
  s.heading_deg = truth.heading_deg;
  s.height_difference_m = truth.height_difference_m;
  take_cir(x.cir, true, s);
  return nlos::compute_features(s);
}

std::string lacking_in_flight(const ml::Model& model) {
  std::string out;
  for (const auto& name : model.info.features) {
    const auto feature = nlos::feature_of(name);
    const char* why = "a column that only its own table has";
    if (feature && nlos::live_ranges_have(*feature)) continue;
    if (feature) {
      switch (nlos::needs_of(*feature)) {
        case nlos::Needs::range:
        case nlos::Needs::impulse:
          break;
        case nlos::Needs::record:
          why = "of a whole impulse response, of which a flight reads a window";
          break;
        case nlos::Needs::registers:
          why = "from registers that only campaigns keep";
          break;
        case nlos::Needs::label:
          why = "noted by a person in campaigns";
          break;
        case nlos::Needs::rest:
          why = "of several rangings at rest";
          break;
      }
    }
    out += (out.empty() ? "" : ", ") + name + " (" + why + ")";
  }
  return out;
}

}  // namespace anchord::api
