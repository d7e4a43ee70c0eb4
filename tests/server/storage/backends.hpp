#pragma once

#include <set>

#include "server/storage/migrate.hpp"
#include "server/storage/postgres_database.hpp"
#include "tests/server/storage/postgres_server.hpp"
#include "tests/server/storage/store_contract.hpp"

namespace anchord {

inline std::unique_ptr<Database> opened_or_told(Result<std::unique_ptr<Database>> db) {
  EXPECT_TRUE(db) << db.error().message;
  return db ? std::move(db).value() : nullptr;
}

inline std::unique_ptr<Database> open_sqlite(const std::filesystem::path& dir) {
  StorageOptions options;
  options.data_dir = dir;
  options.reserve_bytes = 0;
  return opened_or_told(open_database(options));
}

/// The folder stands for a database: the same one when it is opened again.
inline std::unique_ptr<Database> open_postgresql(const std::filesystem::path& dir) {
  static std::set<std::string> made;
  const std::string name = "test_" + sql::sha256_hex(dir.string()).substr(0, 16);
  if (made.insert(name).second) postgres_server().execute("CREATE DATABASE " + name);
  PostgresOptions options;
  options.address = postgres_server().address(name);
  options.data_dir = dir;
  return opened_or_told(open_postgres(options));
}

inline std::string sqlite_missing() { return {}; }
inline std::string postgresql_missing() {
  return PostgresServer::installed() ? "" : "NOT TESTED: Debian package postgresql-15 is not installed";
}

inline auto backends() {
  return testing::Values(Backend{"sqlite", open_sqlite, sqlite_missing},
                         Backend{"postgresql", open_postgresql, postgresql_missing});
}
inline std::string backend_name(const testing::TestParamInfo<Backend>& info) { return info.param.name; }

}  // namespace anchord
