#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace anchord::server {

/// Counters of the transport in Prometheus text. Labels are route templates, never paths. Thread-safe.
class Metrics {
 public:
  explicit Metrics(std::string_view version);
  ~Metrics();
  void answered(std::string_view route, std::string_view method, int status, double seconds);
  /// A value asked for at each scrape.
  void gauge(std::string name, std::string help, std::function<double()> read);
  std::string text();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::server
