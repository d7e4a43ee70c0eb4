#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "server/storage/sql.hpp"
#include "server/storage/sqlite_database.hpp"

struct sqlite3;

namespace anchord::sql {

/// One SQLite connection with the settings of docs/durability.md.
class SqliteConnection final : public Connection {
 public:
  enum class Mode : std::uint8_t {
    read_only,
    inspect,  ///< only reads, but may finish what a killed process left half done (a hot journal)
    read_write,
    create,
  };
  SqliteConnection(const std::filesystem::path& file, Mode mode, Synchronous synchronous,
                   std::optional<std::uint32_t> max_pages);
  ~SqliteConnection() override;

  Statement& prepared(std::string_view sql) override;
  void execute(const std::string& sql) override;
  Keys insert_rows(const BulkTable& table, std::size_t n, const BindRow& bind) override;

  std::int64_t pragma(const std::string& name);  ///< the integer it answers
  bool read_only_file();                         ///< opened for writing, but the file did not allow it
  bool in_transaction();
  int wal_pages() const;         ///< pages in the WAL after the last commit
  void checkpoint_passive();     ///< sets wal_pages to 0 when all of it reached the database
  std::string check(bool full);  ///< "ok", or what is damaged
  sqlite3* handle();

 private:
  bool insert_together(Query& query, const BulkTable& table, std::size_t n, Keys& keys);

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::sql
