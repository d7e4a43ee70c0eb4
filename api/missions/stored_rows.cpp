#include "api/missions/stored_rows.hpp"

#include <utility>

namespace anchord::api {

StoredRows::StoredRows(MeasurementStore& store, const MissionId& mission, bool with_cir) : store_(store) {
  ranges_.filter.mission = fixes_.filter.mission = mission;
  ranges_.filter.limit = fixes_.filter.limit = k_page;
  ranges_.filter.with_cir = with_cir;
}

template <class Row, class Read>
void StoredRows::refill(Stream<Row>& stream, Read read) {
  if (failed_ || !stream.rows.empty() || !stream.more) return;
  auto page = read(stream.filter);
  failed_ = !page;
  if (failed_) return;
  for (auto& row : page.value().rows) stream.rows.push_back(std::move(row));
  stream.filter.after = page.value().next;
  stream.more = !stream.filter.after.empty();
}

template <class Row>
Row StoredRows::pop(Stream<Row>& stream) {
  Row row = std::move(stream.rows.front());
  stream.rows.pop_front();
  return row;
}

std::optional<std::variant<Range, Fix>> StoredRows::next() {
  refill(ranges_, [&](const auto& filter) { return store_.ranges(filter); });
  refill(fixes_, [&](const auto& filter) { return store_.fixes(filter); });
  if (failed_ || (ranges_.rows.empty() && fixes_.rows.empty())) return std::nullopt;
  const bool range_first =
      fixes_.rows.empty() || (!ranges_.rows.empty() && ranges_.rows.front().time < fixes_.rows.front().time);
  if (range_first) return pop(ranges_);
  return pop(fixes_);
}

}  // namespace anchord::api
