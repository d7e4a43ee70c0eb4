#pragma once

#include <span>
#include <string_view>

namespace anchord {

/// One step of the schema, embedded in the binary from migrations/<database>/NNNN_name.sql.
struct Migration {
  int number;
  std::string_view name;
  std::string_view sql;
};

std::span<const Migration> sqlite_migrations();
/// The same numbers and names: a version means the same tables in both.
std::span<const Migration> postgresql_migrations();

}  // namespace anchord
