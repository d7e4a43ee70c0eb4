// Features of full CIRs and predictions of the default classifier, one thread.
#include <benchmark/benchmark.h>

#include <array>
#include <string>
#include <vector>

#include "core/ml/learn.hpp"
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

/// 1: with the shape of the whole record, as campaigns have it; 0: without, as a model in flight looks at it.
void features_of_complex_cirs(benchmark::State& state) {
  nlos::CirOptions options;
  options.whole_record = state.range(0) != 0;
  const auto taps = records();
  nlos::DiagnosticSample sample;
  sample.range_m = 6, sample.preamble_count = 1000, sample.std_noise = 40;
  sample.fp_amp1 = 9000, sample.fp_amp2 = 11000, sample.fp_amp3 = 8000, sample.cir_power = 9143;
  for (auto _ : state) {
    for (std::size_t r = 0; r < k_records; ++r) {
      sample.cir = nlos::cir_shape(std::span{taps}.subspan(r * 2 * k_taps, 2 * k_taps), 746.3, options);
      benchmark::DoNotOptimize(nlos::compute_features(sample));
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(k_records));
}
BENCHMARK(features_of_complex_cirs)->Arg(0)->Arg(1);

constexpr std::size_t k_features = 7, k_rows = 1000;

// Two classes that overlap, seven features, a bias that grows behind walls.
ml::Dataset made_up_rows() {
  ml::Dataset data;
  for (std::size_t f = 0; f < k_features; ++f) data.features.push_back("f" + std::to_string(f));
  ml::Random random{2};
  for (std::uint32_t i = 0; i < k_rows; ++i) {
    double sum = 0;
    for (std::size_t f = 0; f < k_features; ++f) {
      data.x.push_back(random.uniform());
      sum += data.x.back();
    }
    data.los.push_back(sum + random.uniform() > 4);
    data.bias_m.push_back(data.los.back() ? 0.05 : 0.4 + 0.2 * random.uniform());
    data.weight.push_back(1);
    data.group.push_back(i);
    data.placement.push_back(i);
  }
  return data;
}

ml::Model model_of(const ml::Dataset& data, ml::Method method) {
  ml::Recipe recipe;
  recipe.method = method;
  recipe.features = data.features;
  ml::Model model;
  model.info.features = data.features;
  if (ml::suits(method, ml::Task::nlos_id))
    model.classifier = ml::fit_classifier(data, recipe).value();
  else
    model.regressor = ml::fit_regressor(data, recipe).value();
  return model;
}

// One live range after another.
void predict_single(benchmark::State& state) {
  const auto data = made_up_rows();
  const auto model = model_of(data, static_cast<ml::Method>(state.range(0)));
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(ml::predict(model, data.row(i++ % k_rows)));
  state.SetItemsProcessed(state.iterations());
}

// A whole table into memory, as an evaluation does.
void predict_batch(benchmark::State& state) {
  const auto data = made_up_rows();
  const auto model = model_of(data, static_cast<ml::Method>(state.range(0)));
  std::vector<ml::Prediction> out(k_rows);
  for (auto _ : state) {
    for (std::size_t i = 0; i < k_rows; ++i) out[i] = ml::predict(model, data.row(i));
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(k_rows));
}

void methods(benchmark::internal::Benchmark* bench) {
  for (const auto method :
       {ml::Method::logistic, ml::Method::random_forest, ml::Method::svm, ml::Method::boosted,
        ml::Method::average, ml::Method::univariate, ml::Method::multivariate})
    bench->Arg(static_cast<std::int64_t>(method));
}
BENCHMARK(predict_single)->Apply(methods);
BENCHMARK(predict_batch)->Apply(methods);

}  // namespace
