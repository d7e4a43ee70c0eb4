#include "server/app/metrics.hpp"

#include <prometheus/collectable.h>
#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <vector>

#include "core/base/locked.hpp"

namespace anchord::server {

namespace {

/// Values that are asked for when somebody collects, each a family of one gauge.
class ReadGauges final : public prometheus::Collectable {
 public:
  void add(std::string name, std::string help, std::function<double()> read) {
    auto reads = reads_.lock();
    reads->push_back({std::move(name), std::move(help), std::move(read)});
  }
  std::vector<prometheus::MetricFamily> Collect() const override {
    // What they read has locks of its own: none of ours is held meanwhile.
    const auto reads = reads_.copy();
    std::vector<prometheus::MetricFamily> out;
    for (const auto& [name, help, read] : reads) {
      prometheus::ClientMetric value;
      value.gauge.value = read();
      out.push_back({name, help, prometheus::MetricType::Gauge, {value}});
    }
    return out;
  }

 private:
  struct Read {
    std::string name, help;
    std::function<double()> read;
  };
  Locked<std::vector<Read>> reads_;
};

}  // namespace

/// The counters of one kind of answer. Prometheus finds them by maps of strings, which is dearer than the
/// answer.
struct AnswerSeries {
  prometheus::Counter* requests;
  prometheus::Histogram* durations;
};

struct Metrics::State {
  prometheus::Registry registry;
  /// By route, then method and status. As many as the routes have: none is ever removed.
  using OfRoute = std::map<std::pair<std::string, int>, AnswerSeries>;
  Locked<std::map<std::string, OfRoute, std::less<>>> series;
  ReadGauges gauges;
  prometheus::Family<prometheus::Counter>* requests{};
  prometheus::Family<prometheus::Histogram>* durations{};
  AnswerSeries of(std::string_view route, std::string_view method, int status);
};

AnswerSeries Metrics::State::of(std::string_view route, std::string_view method, int status) {
  static const prometheus::Histogram::BucketBoundaries k_buckets{
      0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 10};
  auto known = series.lock();
  auto at = known->find(route);
  if (at == known->end()) at = known->emplace(route, OfRoute{}).first;
  const std::pair key{std::string(method), status};
  if (const auto found = at->second.find(key); found != at->second.end()) return found->second;
  const std::string text(route);
  const AnswerSeries made{
      &requests->Add({{"route", text}, {"method", std::string(method)}, {"code", std::to_string(status)}}),
      &durations->Add({{"route", text}}, k_buckets)};
  at->second.emplace(key, made);
  return made;
}

Metrics::Metrics(std::string_view version) : state_(std::make_unique<State>()) {
  auto& registry = state_->registry;
  state_->requests = &prometheus::BuildCounter()
                          .Name("anchord_http_requests_total")
                          .Help("Requests answered, by route template, method and status")
                          .Register(registry);
  state_->durations =
      &prometheus::BuildHistogram()
           .Name("anchord_http_request_duration_seconds")
           .Help("Seconds from the last byte of the request head to the last byte of the answer")
           .Register(registry);
  prometheus::BuildGauge()
      .Name("anchord_build_info")
      .Help("Always 1; the labels identify the build")
      .Register(registry)
      .Add({{"version", std::string(version)}})
      .Set(1);
}
Metrics::~Metrics() = default;

void Metrics::answered(std::string_view route, std::string_view method, int status, double seconds) {
  const AnswerSeries series = state_->of(route.empty() ? "none" : route, method, status);
  series.requests->Increment();
  series.durations->Observe(seconds);
}

void Metrics::gauge(std::string name, std::string help, std::function<double()> read) {
  state_->gauges.add(std::move(name), std::move(help), std::move(read));
}

std::string Metrics::text() {
  auto families = state_->registry.Collect();
  std::ranges::move(state_->gauges.Collect(), std::back_inserter(families));
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace anchord::server
