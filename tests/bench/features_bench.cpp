// Features of full CIRs and predictions of the default classifier, one thread.
#include <benchmark/benchmark.h>

#include <array>

#include "core/ml/random.hpp"
#include "core/ml/recipe.hpp"
#include "core/nlos/features.hpp"

namespace {

using namespace anchord;

constexpr std::size_t k_taps = 1016, k_records = 64;

// Noise of some 40 counts, a pulse at tap 746 and its decaying echoes, as DW1000 records look.
std::vector<std::int16_t> records() {
  ml::Random random{1};
  std::vector<std::int16_t> out;
  for (std::size_t r = 0; r < k_records; ++r)
    for (std::size_t k = 0; k < k_taps; ++k) {
      const double echo = k >= 746 && k < 860 ? 6000.0 / static_cast<double>(k - 744) : 0;
      for (int part = 0; part < 2; ++part)
        out.push_back(static_cast<std::int16_t>((random.uniform() - 0.5) * (140 + echo)));
    }
  return out;
}

void features_of_complex_cirs(benchmark::State& state) {
  const auto taps = records();
  nlos::DiagnosticSample sample;
  sample.range_m = 6, sample.preamble_count = 1000, sample.std_noise = 40;
  sample.fp_amp1 = 9000, sample.fp_amp2 = 11000, sample.fp_amp3 = 8000, sample.cir_power = 9143;
  for (auto _ : state) {
    for (std::size_t r = 0; r < k_records; ++r) {
      sample.cir = nlos::cir_shape(std::span{taps}.subspan(r * 2 * k_taps, 2 * k_taps), 746.3);
      benchmark::DoNotOptimize(nlos::compute_features(sample));
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(k_records));
}
BENCHMARK(features_of_complex_cirs);

void predict_average_of_three(benchmark::State& state) {
  ml::Dataset data;
  ml::Recipe recipe;
  for (int f = 0; f < 7; ++f) data.features.push_back("f" + std::to_string(f));
  recipe.features = data.features;
  ml::Random random{2};
  for (std::uint32_t i = 0; i < 1000; ++i) {
    double sum = 0;
    for (int f = 0; f < 7; ++f) {
      data.x.push_back(random.uniform());
      sum += data.x.back();
    }
    data.los.push_back(sum + random.uniform() > 4);
    data.weight.push_back(1);
    data.group.push_back(i);
    data.placement.push_back(i);
  }
  const auto model = ml::fit_classifier(data, recipe).value();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(model.p_los(data.row(i++ % data.rows())));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(predict_average_of_three);

}  // namespace
