#pragma once

#include <algorithm>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord {

using ExclusionId = Id<struct ExclusionTag>;

enum class RowKind : std::uint8_t { ranges, fixes };
inline constexpr auto k_row_kind_words =
    enum_table<RowKind>({{"ranges", RowKind::ranges}, {"fixes", RowKind::fixes}});

/// One measurement by what it is, wherever it is kept: a range by all four, a fix by its time. To the
/// microsecond, which is what the wire and files carry.
struct RowKey {
  UtcTime time{};
  NetworkId tag{}, anchor{};
  std::uint8_t antenna{0};
  auto operator<=>(const RowKey&) const = default;
};
inline RowKey row_key(UtcTime time, NetworkId tag = {}, NetworkId anchor = {}, std::uint8_t antenna = 0) {
  const std::int64_t over = ((time.ns % 1000) + 1000) % 1000;
  return {{time.ns - over + (over >= 500 ? 1000 : 0)}, tag, anchor, antenna};
}
inline RowKey key_of(const Range& range) {
  return row_key(range.time, range.tag, range.anchor, range.antenna);
}
inline RowKey key_of(const Fix& fix) { return row_key(fix.time); }

/// Which measurements of a flight: those named, or a span of time, of one anchor or tag where that is said.
struct RowSelection {
  RowKind kind{RowKind::ranges};
  std::vector<RowKey> rows{};                ///< ascending; not empty: these, and nothing else is said
  std::optional<UtcTime> since{}, until{};   ///< until: not included
  std::optional<NetworkId> anchor{}, tag{};  ///< of ranges

  bool has(const Range& range) const {
    if (kind != RowKind::ranges) return false;
    if (!rows.empty()) return std::ranges::binary_search(rows, key_of(range));
    return within(range.time) && (!anchor || *anchor == range.anchor) && (!tag || *tag == range.tag);
  }
  bool has(const Fix& fix) const {
    if (kind != RowKind::fixes) return false;
    if (!rows.empty()) return std::ranges::binary_search(rows, key_of(fix));
    return within(fix.time);
  }

 private:
  bool within(UtcTime time) const { return (!since || *since <= time) && (!until || time < *until); }
};

/// A person's word that measurements are not to be used. They stay as they came; this is a row of its own,
/// and so is the word that takes it back.
struct Exclusion {
  struct Included {
    UtcTime time{};
    std::string by, reason;
  };
  ExclusionId id{};
  MissionId mission{};
  RowSelection selection{};
  std::string reason, by;
  UtcTime created{};
  std::uint64_t n_rows{};  ///< that it named when it was made
  std::optional<Included> included{};

  bool applies() const { return !included; }
};

/// True when one of those that apply has the row.
template <class Row>
bool excluded(const std::vector<Exclusion>& exclusions, const Row& row) {
  return std::ranges::any_of(exclusions,
                             [&](const Exclusion& e) { return e.applies() && e.selection.has(row); });
}

}  // namespace anchord
