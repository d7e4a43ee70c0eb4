#include "api/calibration/flight_loading.hpp"

#include <gtest/gtest.h>

#include "core/localize/convergence.hpp"

namespace anchord::api::flight_loading_test {
namespace {

FlightData part_of(int first, int last) {
  FlightData part;
  for (int i = first; i < last; ++i) {
    Range range;
    range.seq = static_cast<std::uint64_t>(i);
    range.distance_m = i;
    part.ranges.push_back(range);
  }
  return part;
}

/// Half a metre off each range, and an error model for those after the first.
FlightData corrected(FlightData part) {
  part.error_models.resize(part.ranges.size());
  for (std::size_t i = 0; i < part.ranges.size(); ++i) {
    part.received_m.push_back(part.ranges[i].distance_m);
    part.ranges[i].distance_m -= 0.5;
    if (i > 0) part.error_models[i] = RangeErrorModel{0.1 * static_cast<double>(i)};
  }
  return part;
}

TEST(FlightParts, KeepWhatModelsMadeOfEachRangeWhicheverPartsTheySpokeAbout) {
  FlightData flight;
  append_rows(flight, part_of(0, 3));
  append_rows(flight, corrected(part_of(3, 6)));
  append_rows(flight, FlightData{});
  append_rows(flight, part_of(6, 8));
  ASSERT_EQ(flight.n_ranges(), 8U);
  ASSERT_EQ(flight.error_models.size(), 8U);
  ASSERT_EQ(flight.received_m.size(), 8U);
  for (std::size_t i = 0; i < 8; ++i) {
    const bool of_second = i >= 3 && i < 6;
    EXPECT_EQ(flight.range(i).seq, i);
    EXPECT_EQ(flight.received_m[i], static_cast<double>(i));
    EXPECT_EQ(flight.range(i).distance_m, static_cast<double>(i) - (of_second ? 0.5 : 0.0));
    EXPECT_EQ(flight.error_models[i].has_value(), i == 4 || i == 5) << i;
  }
  EXPECT_EQ(flight.error_models[5]->p_los, 0.2);
  const FlightData raw = as_received(flight);
  EXPECT_TRUE(raw.error_models.empty() && raw.received_m.empty());
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(raw.range(i).distance_m, static_cast<double>(i));
}

TEST(FlightParts, HaveNothingOfModelsWhereNoneSpoke) {
  FlightData flight;
  append_rows(flight, part_of(0, 3));
  append_rows(flight, part_of(3, 4));
  EXPECT_EQ(flight.n_ranges(), 4U);
  EXPECT_TRUE(flight.error_models.empty() && flight.received_m.empty() && flight.ranges.empty());
}

}  // namespace
}  // namespace anchord::api::flight_loading_test
