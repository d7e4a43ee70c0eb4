#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "core/base/enum_table.hpp"

namespace anchord {

/// What a column of a flight bundle holds. `id` is the 16 bytes of a UUID.
enum class CellKind : std::uint8_t { integer, real, text, bytes, id };
inline constexpr auto k_cell_kind_words = enum_table<CellKind>({{"integer", CellKind::integer},
                                                                {"real", CellKind::real},
                                                                {"text", CellKind::text},
                                                                {"bytes", CellKind::bytes},
                                                                {"id", CellKind::id}});

struct BundleColumn {
  std::string name;
  CellKind kind{CellKind::text};
  /// Came when there were bundles already: one at the end of a table of one row, and only where it has a
  /// value, so that what says nothing in it is the bundle that it was.
  bool later{false};
};
/// One value: nothing, an integer, a real, or (text, bytes, id) a string of bytes. Real values are compared
/// and carried bit for bit.
using BundleCell = std::variant<std::monostate, std::int64_t, double, std::string>;
using BundleRow = std::vector<BundleCell>;

/// Rows of one kind that belong to a flight; columns stand in the order of the cells of its rows.
struct BundleTable {
  std::string name;
  std::vector<BundleColumn> columns;
  /// Came when there were bundles already: there only where it has rows, so that what has none is the bundle
  /// that it was.
  bool later{false};
};

}  // namespace anchord
