#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "server/storage/sql.hpp"

/// The rows of all tables as plain values, for whoever moves or compares whole databases.
namespace anchord::sql {

/// NULL, integer, real, text, blob.
using Cell = std::variant<std::monostate, std::int64_t, double, std::string, std::vector<std::byte>>;
using Cells = std::vector<Cell>;

struct RowTable {
  enum class Type : std::uint8_t { integer, real, text, blob };
  std::string name;
  std::vector<std::string> columns;
  std::vector<Type> types;
  std::vector<std::size_t> key;  ///< the primary key, as indexes of columns
  std::string list() const;      ///< "a, b, c"
};

/// Every table of this program's newest version but schema_migration and server_lease, which are of the
/// database itself, in an order in which rows can be added: what is named stands before what names it. The
/// same in both databases (postgres_test.cpp).
std::vector<RowTable> row_tables();

/// Rows in the order of the key, a few mebibytes at a time.
class RowPages {
 public:
  RowPages(Connection& connection, const RowTable& table) : connection_(connection), table_(table) {}
  /// Begin behind the row with this key.
  void begin_after(Cells key) { after_ = std::move(key); }
  /// Empty: there are no more.
  std::vector<Cells> next();

 private:
  Connection& connection_;
  const RowTable& table_;
  Cells after_;
  std::size_t rows_{16};
};

/// The key of the last row; empty when there is none.
Cells last_key(Connection& connection, const RowTable& table);
void insert_cells(Connection& connection, const RowTable& table, const std::vector<Cells>& rows);
std::uint64_t count_rows(Connection& connection, const RowTable& table);

/// What a table holds: equal digests, equal rows, whichever the database.
struct TableDigest {
  std::string table;
  std::uint64_t rows{};
  std::string sha256_hex;
  bool operator==(const TableDigest&) const = default;
};
TableDigest digest_of(Connection& connection, const RowTable& table);

}  // namespace anchord::sql
