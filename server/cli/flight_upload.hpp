#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/base/result.hpp"
#include "core/types/flight_data.hpp"
#include "server/cli/rest_client.hpp"

namespace anchord::cli {

/// Sorts fixes and ranges by time and numbers those that have no sequence number, so that rows of one
/// microsecond stay apart and a batch that is sent again is recognised.
void prepare_rows(FlightData& flight);

/// Sends one flight: a fresh mission, then its rows in order of time.
class FlightUpload {
 public:
  static constexpr std::size_t k_batch_rows = 1000;

  FlightUpload(RestClient& client, FlightData flight);  ///< prepared
  Result<void> create_mission(const std::string& name);
  /// One that was made before, in place of create_mission(): rows that it has already count as duplicates.
  Result<void> use_mission(const std::string& id);
  /// All rows before `until`, at most k_batch_rows of each kind in a request.
  Result<void> send_before(UtcTime until);
  Result<void> send_next_batch();
  Result<void> finish_mission();

  bool done() const { return next_fix_ == flight_.fixes.size() && next_range_ == flight_.ranges.size(); }
  void shift(std::int64_t offset_ns);
  UtcTime first() const;
  UtcTime last() const;
  double fraction() const;
  const std::string& mission_id() const { return mission_id_; }
  /// "9 999 accepted, 1 duplicate, 1 rejected (zero_distance: ...)"
  std::string summary() const;

 private:
  template <class Row>
  Result<void> post_rows(const char* path, std::span<Row> rows);

  RestClient& client_;
  FlightData flight_;
  std::size_t next_fix_{0}, next_range_{0};
  std::string mission_id_;
  std::uint64_t accepted_{0}, duplicates_{0}, rejected_{0};
  std::string first_error_;
};

}  // namespace anchord::cli
