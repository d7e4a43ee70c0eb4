#include "api/calibration/flight_loading.hpp"

#include <algorithm>
#include <utility>

namespace anchord::api {
namespace {

/// Calls `add` with the pages of one kind of rows. errors: of the store, canceled
template <class Page, class Add>
Result<void> for_pages(MeasurementStore::Filter filter, const FlightLoading& how, const Page& page,
                       const Add& add) {
  do {
    if (how.canceled()) return make_error(Errc::canceled, "canceled");
    BOOST_OUTCOME_TRY(auto rows, page(filter));
    filter.after = rows.next;
    add(std::move(rows.rows));
  } while (!filter.after.empty());
  return boost::outcome_v2::success();
}

}  // namespace

void append_rows(FlightData& flight, FlightData part) {
  part.keep_rows();
  const std::size_t before = flight.rows.size(), after = before + part.rows.size();
  if (!flight.error_models.empty() || !part.error_models.empty()) {
    flight.error_models.reserve(std::max(after, flight.rows.capacity()));
    flight.error_models.resize(before);
    flight.error_models.insert(flight.error_models.end(), part.error_models.begin(), part.error_models.end());
    flight.error_models.resize(after);
  }
  if (!flight.received_m.empty() || !part.received_m.empty()) {
    // Where nothing was corrected, what was received is what the rows have.
    for (std::size_t i = flight.received_m.size(); i < before; ++i)
      flight.received_m.push_back(flight.rows[i].distance_m);
    for (std::size_t i = 0; i < part.rows.size(); ++i)
      flight.received_m.push_back(part.received_m.empty() ? part.rows[i].distance_m : part.received_m[i]);
  }
  flight.rows.insert(flight.rows.end(), part.rows.begin(), part.rows.end());
}

Result<FlightData> load_flight(MeasurementStore& store, const Mission& mission, const FlightLoading& how) {
  FlightData flight;
  flight.mission = mission;
  flight.exclusions = how.exclusions;
  MeasurementStore::Filter filter;
  filter.mission = mission.id;
  filter.limit = 10'000;
  // It is not to be moved as it grows.
  BOOST_OUTCOME_TRY(const auto n_fixes, store.count_fixes(mission.id));
  BOOST_OUTCOME_TRY(const auto n_ranges, store.count_ranges(mission.id));
  flight.fixes.reserve(n_fixes);
  flight.rows.reserve(n_ranges);
  BOOST_OUTCOME_TRYV(for_pages(
      filter, how, [&](const auto& at) { return store.fixes(at); },
      [&](std::vector<Fix> fixes) {
        for (Fix& fix : fixes) {
          if (excluded(how.exclusions, fix))
            ++flight.n_fixes_excluded;
          else
            flight.fixes.push_back(std::move(fix));
        }
      }));
  filter.with_cir = how.with_cir;
  if (how.with_cir) filter.limit = 1000;  // 4 kB each
  BOOST_OUTCOME_TRYV(for_pages(
      filter, how, [&](const auto& at) { return store.ranges(at); },
      [&](std::vector<Range> ranges) {
        FlightData part;
        part.mission = mission;
        std::erase_if(ranges, [&](const Range& range) {
          const bool out = excluded(how.exclusions, range);
          if (out) ++flight.n_ranges_excluded[range.anchor];
          return out || (range.kind == RangeKind::anchor_anchor && !how.between_anchors);
        });
        part.ranges = std::move(ranges);
        if (how.correct) how.correct(part);
        append_rows(flight, std::move(part));
      }));
  return flight;
}

}  // namespace anchord::api
