#pragma once

#include <cstdint>
#include <string>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"

namespace anchord::gateway {

/// How the rows of a batch are written, and with that where they go.
enum class Lines : std::uint8_t { fixes_csv, ranges_csv, ranges_ndjson };
inline constexpr auto k_lines_words = enum_table<Lines>({{"fixes_csv", Lines::fixes_csv},
                                                         {"ranges_csv", Lines::ranges_csv},
                                                         {"ranges_ndjson", Lines::ranges_ndjson}});

/// Rows that were measured while no mission was known: RFC 9562's Max UUID, which no mission has.
inline MissionId unassigned() {
  MissionId id;
  id.uuid.bytes.fill(0xff);
  return id;
}

/// Rows of one kind that came together; they leave together.
struct Batch {
  std::int64_t id{};  ///< in the order of arrival; given by the outbox
  MissionId mission{};
  Lines lines{};
  std::uint32_t n_rows{};
  UtcTime newest{};  ///< measured
  std::string body;  ///< one row a line, without a header
};
/// Of a row of the outbox's table, with its place in two trees.
inline std::uint64_t weight(std::uint64_t body_bytes) { return body_bytes + 120; }
inline std::uint64_t weight(const Batch& batch) { return weight(batch.body.size()); }

/// Since the outbox was made; kept with the rows.
struct Totals {
  std::uint64_t kept{}, accepted{}, duplicates{}, rejected{};
  bool operator==(const Totals&) const = default;
};

}  // namespace anchord::gateway
