#include "core/localize/flight_history.hpp"

#include <algorithm>

namespace anchord {
namespace {

template <class Row>
void halve(std::vector<Row>& rows) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < rows.size(); i += 2) rows[kept++] = std::move(rows[i]);
  rows.resize(kept);
}

}  // namespace

void FlightHistory::add(const Range& range, const std::optional<RangeErrorModel>& error_model) {
  if (ranges_seen_++ % range_stride_ != 0) return;
  if (ranges_.empty()) ranges_.reserve(k_max_ranges);  // growing by doubling needs three times as much
  newest_ = ranges_.empty() ? range.time : std::max(newest_, range.time);
  ranges_.push_back(range);
  ranges_.back().cir.reset();
  if (error_model || !error_models_.empty()) {
    error_models_.resize(ranges_.size());
    error_models_.back() = error_model;
  }
  if (ranges_.size() < k_max_ranges) return;
  halve(ranges_);
  halve(error_models_);
  range_stride_ *= 2;
}

void FlightHistory::add(const Fix& fix) {
  if (fixes_seen_++ % fix_stride_ != 0) return;
  if (fixes_.empty()) fixes_.reserve(k_max_fixes);
  fixes_.push_back(fix);
  if (fixes_.size() < k_max_fixes) return;
  halve(fixes_);
  fix_stride_ *= 2;
}

FlightData FlightHistory::data(const Mission& mission) const {
  FlightData flight;
  flight.mission = mission;
  flight.fixes = fixes_;
  flight.ranges = ranges_;
  flight.error_models = error_models_;
  return flight;
}

void FlightHistory::clear() { *this = FlightHistory{}; }

}  // namespace anchord
