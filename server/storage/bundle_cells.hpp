#pragma once

#include <optional>
#include <string>

#include "core/types/bundle.hpp"
#include "server/storage/bundle_tables.hpp"
#include "server/storage/cir_file.hpp"
#include "server/storage/sql.hpp"

/// The values of a bundle, from and to the database, and in words.
namespace anchord::sql {

BundleRow read_row(Query& query, const BundleTable& table);
/// Behind the columns of read_row(): of a range whose impulse response is in a file.
std::optional<CirDigest> read_moved(Query& query, const BundleSpec& spec);
void bind_cell(Query& query, const BundleCell& cell, CellKind kind);

/// Bit for bit, but that SQLite does not keep the sign of a zero, which PostgreSQL does.
bool same(const BundleCell& a, const BundleCell& b);
Uuid uuid_of(const BundleCell& cell);
std::int64_t whole_of(const BundleCell& cell);

std::string in_words(const BundleCell& cell, const BundleColumn& column);
/// "anchor 0x6a2f", "kit_profile xcel 3"
std::string name_of(const BundleSpec& spec, const BundleRow& row);

}  // namespace anchord::sql
