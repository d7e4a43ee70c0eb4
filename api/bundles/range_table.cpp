#include "api/bundles/range_table.hpp"

#include <cmath>
#include <deque>
#include <optional>

#include "core/base/enum_table.hpp"
#include "core/ports/measurement_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_rows_a_page = 1000;
constexpr double k_max_gap_s = 2;

using Type = FeatureTable::Type;
using Value = FeatureTable::Value;

FeatureTable head_of_ranges() {
  FeatureTable table;
  table.name = "ranges";
  table.title = "UWB ranges";
  table.description = "Each at the position of the aircraft's receiver; distances as received";
  table.columns = {{"id", Type::integer},       {"time", Type::time},        {"t_us", Type::integer},
                   {"kind", Type::text},        {"tag", Type::text},         {"antenna", Type::integer},
                   {"anchor", Type::text},      {"seq", Type::integer},      {"distance_m", Type::real},
                   {"rss_dbm", Type::real},     {"fp_dbm", Type::real},      {"rx_dbm", Type::real},
                   {"std_noise", Type::real},   {"heading_deg", Type::real}, {"truth_distance_m", Type::real},
                   {"truth_los", Type::boolean}};
  return table;
}

template <class To, class From>
Value value_of(const std::optional<From>& value) {
  return value ? Value(static_cast<To>(*value)) : Value();
}

std::vector<Value> values_of(const Range& r, std::int64_t id) {
  const RangeTruth truth = r.truth.value_or(RangeTruth{});
  return {id,
          to_rfc3339(r.time),
          r.time.us(),
          std::string(k_range_kind_words.word(r.kind)),
          to_string(r.tag),
          std::int64_t{r.antenna},
          to_string(r.anchor),
          value_of<std::int64_t>(r.seq),
          r.distance_m,
          value_of<double>(r.rss_dbm),
          value_of<double>(r.fp_dbm),
          value_of<double>(r.rx_dbm),
          value_of<double>(r.std_noise),
          value_of<double>(r.heading_deg),
          value_of<double>(truth.distance_m),
          value_of<bool>(truth.los)};
}

/// Where the receiver was, asked for in order of time.
class Receiver {
 public:
  Receiver(MeasurementStore& store, const MissionId& mission) : store_(store) {
    filter_.mission = mission;
    filter_.limit = k_rows_a_page;
  }
  Result<std::optional<Eigen::Vector3d>> at(UtcTime time) {
    while (true) {
      BOOST_OUTCOME_TRY(const bool more, fill());
      if (!more || next_.front().time.ns >= time.ns) break;
      before_ = next_.front();
      next_.pop_front();
    }
    if (next_.empty()) return std::optional<Eigen::Vector3d>{};
    return between(time);
  }

 private:
  struct Place {
    UtcTime time{};
    Eigen::Vector3d lon_lat_h{0, 0, 0};
  };
  /// Whether there is a position left to come.
  Result<bool> fill() {
    while (next_.empty() && !ended_) {
      BOOST_OUTCOME_TRY(const auto page, store_.fixes(filter_));
      for (const auto& fix : page.rows) {
        if (fix.frame == TrackFrame::wgs84 && fix.fix != FixClass::none)
          next_.push_back({fix.time, {fix.position.lon_deg, fix.position.lat_deg, fix.position.height_m}});
      }
      filter_.after = page.next;
      ended_ = page.next.empty();
    }
    return !next_.empty();
  }
  std::optional<Eigen::Vector3d> between(UtcTime time) const {
    const Place& after = next_.front();
    if (after.time.ns == time.ns) return after.lon_lat_h;
    if (!before_) return std::nullopt;
    const auto whole = static_cast<double>(after.time.ns - before_->time.ns);
    const Eigen::Vector3d step = after.lon_lat_h - before_->lon_lat_h;
    // Over the date line a straight line of degrees leads round the world.
    if (whole > k_max_gap_s * 1e9 || std::abs(step.x()) > 180) return std::nullopt;
    return before_->lon_lat_h + step * (static_cast<double>(time.ns - before_->time.ns) / whole);
  }

  MeasurementStore& store_;
  MeasurementStore::Filter filter_;
  std::deque<Place> next_;
  std::optional<Place> before_;
  bool ended_{false};
};

}  // namespace

Result<void> write_ranges(MeasurementStore& store, const MissionId& mission, const MakeFeatureFile& make,
                          const std::filesystem::path& file, UtcTime now) {
  BOOST_OUTCOME_TRY(const auto out, make(file, head_of_ranges(), now));
  Receiver receiver(store, mission);
  MeasurementStore::Filter filter;
  filter.mission = mission;
  filter.limit = k_rows_a_page;
  do {
    BOOST_OUTCOME_TRY(const auto page, store.ranges(filter));
    std::vector<FeatureTable::Row> rows;
    rows.reserve(page.rows.size());
    for (std::size_t i = 0; i < page.rows.size(); ++i) {
      BOOST_OUTCOME_TRY(const auto place, receiver.at(page.rows[i].time));
      rows.push_back({place ? std::vector{*place} : std::vector<Eigen::Vector3d>{},
                      values_of(page.rows[i], page.ids[i])});
    }
    BOOST_OUTCOME_TRYV(out->add(rows));
    filter.after = page.next;
  } while (!filter.after.empty());
  return out->finish();
}

}  // namespace anchord::api
