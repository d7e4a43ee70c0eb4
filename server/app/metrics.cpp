#include "server/app/metrics.hpp"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <vector>

#include "core/base/locked.hpp"

namespace anchord::server {

struct Metrics::State {
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>* requests{};
  prometheus::Family<prometheus::Histogram>* durations{};
  struct Read {
    prometheus::Gauge* gauge;
    std::function<double()> read;
  };
  Locked<std::vector<Read>> reads;
};

Metrics::Metrics(std::string_view version) : state_(std::make_unique<State>()) {
  auto& registry = state_->registry;
  state_->requests = &prometheus::BuildCounter()
                          .Name("anchord_http_requests_total")
                          .Help("Requests answered, by route template, method and status")
                          .Register(registry);
  state_->durations = &prometheus::BuildHistogram()
                           .Name("anchord_http_request_duration_seconds")
                           .Help("From the last byte of the head to the last byte of the answer")
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
  static const prometheus::Histogram::BucketBoundaries k_buckets{
      0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 10};
  const std::string template_text(route.empty() ? "none" : route);
  state_->requests
      ->Add({{"route", template_text}, {"method", std::string(method)}, {"code", std::to_string(status)}})
      .Increment();
  state_->durations->Add({{"route", template_text}}, k_buckets).Observe(seconds);
}

void Metrics::gauge(std::string name, std::string help, std::function<double()> read) {
  auto& made = prometheus::BuildGauge().Name(name).Help(help).Register(state_->registry).Add({});
  auto reads = state_->reads.lock();
  reads->push_back({&made, std::move(read)});
}

std::string Metrics::text() {
  // What they read has locks of its own: none of ours is held meanwhile.
  const auto reads = state_->reads.copy();
  for (const auto& [gauge, read] : reads) gauge->Set(read());
  return prometheus::TextSerializer().Serialize(state_->registry.Collect());
}

}  // namespace anchord::server
