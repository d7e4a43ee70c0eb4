#include "server/storage/row_tables.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "core/base/sha256.hpp"
#include "migrations/migration.hpp"
#include "server/storage/migrate.hpp"
#include "server/storage/sqlite_connection.hpp"

namespace anchord::sql {
namespace {

constexpr std::size_t k_row_tables_page_bytes = 4u << 20, k_most_rows = 5000;
constexpr const char* k_row_tables_columns =
    "SELECT m.name, p.name, p.type, p.pk FROM sqlite_schema m JOIN pragma_table_info(m.name) p "
    "WHERE m.type = 'table' AND m.name NOT IN ('schema_migration', 'server_lease') ORDER BY m.name, p.cid";
constexpr const char* k_references =
    "SELECT m.name, f.\"table\" FROM sqlite_schema m JOIN pragma_foreign_key_list(m.name) f "
    "WHERE m.type = 'table' AND m.name <> f.\"table\"";

RowTable::Type type_of(const std::string& word) {
  if (word == "INTEGER") return RowTable::Type::integer;
  if (word == "REAL") return RowTable::Type::real;
  if (word == "BLOB") return RowTable::Type::blob;
  ANCHORD_CHECK(word == "TEXT", "a column of type " << word);
  return RowTable::Type::text;
}

std::string joined(const RowTable& table, const std::vector<std::size_t>& columns, const char* behind = "") {
  std::string out;
  for (const auto column : columns) out += (out.empty() ? "" : ", ") + table.columns[column] + behind;
  return out;
}

Cell read_cell(Query& query, RowTable::Type type) {
  if (query.null()) {
    query.skip();
    return {};
  }
  switch (type) {
    case RowTable::Type::integer:
      return query.integer();
    case RowTable::Type::real:
      return query.real();
    case RowTable::Type::text:
      return query.text();
    case RowTable::Type::blob: {
      const auto bytes = query.blob();
      return std::vector<std::byte>(bytes.begin(), bytes.end());
    }
  }
  return {};
}

void bind_cell(Query& query, const Cell& cell) {
  std::visit(
      [&](const auto& value) {
        using T = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<T, std::monostate>)
          query << std::nullopt;
        else if constexpr (std::is_same_v<T, std::vector<std::byte>>)
          query << std::span<const std::byte>(value);
        else
          query << value;
      },
      cell);
}

std::size_t bytes_of(const Cell& cell) {
  if (const auto* text = std::get_if<std::string>(&cell)) return text->size();
  if (const auto* blob = std::get_if<std::vector<std::byte>>(&cell)) return blob->size();
  return sizeof(std::int64_t);
}

/// Kind and length before each value, so that no two rows have the same bytes.
void add_cell(Sha256& digest, const Cell& cell) {
  digest.add(static_cast<std::uint64_t>(cell.index()));
  if (const auto* integer = std::get_if<std::int64_t>(&cell))
    digest.add(static_cast<std::uint64_t>(*integer));
  // SQLite keeps no sign of a zero; nor does this.
  if (const auto* real = std::get_if<double>(&cell)) digest.add(*real);
  if (const auto* text = std::get_if<std::string>(&cell)) {
    digest.add(std::uint64_t{text->size()});
    digest.add(*text);
  }
  if (const auto* blob = std::get_if<std::vector<std::byte>>(&cell)) {
    digest.add(std::uint64_t{blob->size()});
    digest.add(std::string_view{reinterpret_cast<const char*>(blob->data()), blob->size()});
  }
}

}  // namespace

std::string RowTable::list() const {
  std::string out;
  for (const auto& column : columns) out += (out.empty() ? "" : ", ") + column;
  return out;
}

std::vector<RowTable> row_tables() {
  // The schema as this program makes it, not as a file may be damaged.
  SqliteConnection schema(":memory:", SqliteConnection::Mode::create, Synchronous::normal, std::nullopt);
  const auto made = migrate(schema, sqlite_migrations(), {}, UtcTime{});
  ANCHORD_CHECK(made, made.error().message);
  std::map<std::string, RowTable> waiting;
  Query columns(schema, k_row_tables_columns);
  while (columns.step()) {
    const auto name = columns.text();
    RowTable& table = waiting[name];
    table.name = name;
    table.columns.push_back(columns.text());
    table.types.push_back(type_of(columns.text()));
    if (const auto place = columns.as<std::size_t>(); place > 0) {
      if (table.key.size() < place) table.key.resize(place);
      table.key[place - 1] = table.columns.size() - 1;
    }
  }
  std::map<std::string, std::set<std::string>> named;
  Query references(schema, k_references);
  while (references.step()) {
    const auto from = references.text();
    named[from].insert(references.text());
  }
  std::vector<RowTable> out;
  while (!waiting.empty()) {
    const auto free = std::ranges::find_if(waiting, [&](const auto& one) {
      return std::ranges::none_of(named[one.first], [&](const auto& name) { return waiting.contains(name); });
    });
    ANCHORD_CHECK(free != waiting.end(), "tables reference each other in a circle");
    out.push_back(std::move(free->second));
    waiting.erase(free);
  }
  return out;
}

std::vector<Cells> RowPages::next() {
  std::string text = "SELECT " + table_.list() + " FROM " + table_.name;
  const auto keys = joined(table_, table_.key);
  if (!after_.empty()) {
    text += " WHERE (" + keys + ") > (?1";
    for (std::size_t i = 2; i <= after_.size(); ++i) text += ", ?" + std::to_string(i);
    text += ")";
  }
  Query query(connection_, text + " ORDER BY " + keys + " LIMIT ?" + std::to_string(after_.size() + 1));
  for (const Cell& cell : after_) bind_cell(query, cell);
  query << static_cast<std::int64_t>(rows_);
  std::vector<Cells> page;
  std::size_t bytes = 0;
  while (query.step()) {
    Cells row;
    row.reserve(table_.types.size());
    for (const auto type : table_.types) {
      row.push_back(read_cell(query, type));
      bytes += bytes_of(row.back());
    }
    page.push_back(std::move(row));
  }
  if (page.empty()) return page;
  after_.clear();
  for (const auto column : table_.key) after_.push_back(page.back()[column]);
  rows_ = std::clamp<std::size_t>(k_row_tables_page_bytes / std::max<std::size_t>(1, bytes / page.size()), 1,
                                  k_most_rows);
  return page;
}

Cells last_key(Connection& connection, const RowTable& table) {
  Query query(connection, "SELECT " + joined(table, table.key) + " FROM " + table.name + " ORDER BY " +
                              joined(table, table.key, " DESC") + " LIMIT 1");
  Cells key;
  if (!query.step()) return key;
  for (const auto column : table.key) key.push_back(read_cell(query, table.types[column]));
  return key;
}

void insert_cells(Connection& connection, const RowTable& table, const std::vector<Cells>& rows) {
  const std::string columns = table.list();
  connection.insert_rows({table.name, columns}, rows.size(), [&](Query& query, std::size_t row) {
    for (const Cell& cell : rows[row]) bind_cell(query, cell);
  });
}

std::uint64_t count_rows(Connection& connection, const RowTable& table) {
  Query query(connection, "SELECT count(*) FROM " + table.name);
  return query.step() ? query.as<std::uint64_t>() : 0;
}

TableDigest digest_of(Connection& connection, const RowTable& table) {
  TableDigest out{table.name, 0, {}};
  Sha256 digest;
  RowPages pages(connection, table);
  for (auto page = pages.next(); !page.empty(); page = pages.next()) {
    for (const Cells& row : page) {
      for (const Cell& cell : row) add_cell(digest, cell);
    }
    out.rows += page.size();
  }
  out.sha256_hex = digest.hex();
  return out;
}

}  // namespace anchord::sql
