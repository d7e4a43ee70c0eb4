#include "server/storage/bundle_cells.hpp"

#include <bit>
#include <cstring>

#include "server/storage/measurement_rows.hpp"

namespace anchord::sql {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span{text}); }

BundleCell read_cell(Query& query, CellKind kind) {
  if (query.null()) {
    query.skip();
    return std::monostate{};
  }
  switch (kind) {
    case CellKind::integer:
      return query.integer();
    case CellKind::real:
      return query.real();
    case CellKind::text:
      return query.text();
    case CellKind::bytes:
    case CellKind::id: {
      const auto bytes = query.blob();
      return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }
  }
  return std::monostate{};
}

}  // namespace

BundleRow read_row(Query& query, const BundleTable& table) {
  BundleRow row;
  row.reserve(table.columns.size());
  for (const auto& column : table.columns) row.push_back(read_cell(query, column.kind));
  return row;
}

std::optional<CirDigest> read_moved(Query& query, const BundleSpec& spec) {
  if (!spec.with_cir || query.null()) return std::nullopt;
  return read_digest(query);
}

void bind_cell(Query& query, const BundleCell& cell, CellKind kind) {
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) {
    query << *whole;
  } else if (const auto* real = std::get_if<double>(&cell)) {
    query << *real;
  } else if (const auto* text = std::get_if<std::string>(&cell)) {
    if (kind == CellKind::text)
      query << *text;
    else
      query << bytes_of(*text);
  } else {
    query << std::nullopt;
  }
}

bool same(const BundleCell& a, const BundleCell& b) {
  const auto* x = std::get_if<double>(&a);
  const auto* y = std::get_if<double>(&b);
  if (x != nullptr && y != nullptr)
    return *x == *y || std::bit_cast<std::uint64_t>(*x) == std::bit_cast<std::uint64_t>(*y);
  return a == b;
}

Uuid uuid_of(const BundleCell& cell) {
  Uuid id;
  const auto* text = std::get_if<std::string>(&cell);
  if (text != nullptr && text->size() == id.bytes.size()) std::memcpy(id.bytes.data(), text->data(), 16);
  return id;
}

std::int64_t whole_of(const BundleCell& cell) {
  const auto* whole = std::get_if<std::int64_t>(&cell);
  return whole != nullptr ? *whole : -1;
}

std::string in_words(const BundleCell& cell, const BundleColumn& column) {
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) {
    const bool radio = column.name == "network_id" || column.name == "tag" || column.name == "anchor";
    return radio ? to_string(NetworkId{static_cast<std::uint32_t>(*whole)}) : std::to_string(*whole);
  }
  if (const auto* text = std::get_if<std::string>(&cell))
    return column.kind == CellKind::id ? to_string(uuid_of(cell)) : *text;
  return "none";
}

std::string name_of(const BundleSpec& spec, const BundleRow& row) {
  std::string name = spec.table.name;
  for (const std::size_t key : spec.keys) name += ' ' + in_words(row[key], spec.table.columns[key]);
  return name;
}

}  // namespace anchord::sql
