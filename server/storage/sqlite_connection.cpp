#include "server/storage/sqlite_connection.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <sqlite3.h>

#include <cerrno>
#include <cstring>
#include <unordered_map>

#include "server/storage/text_hash.hpp"

namespace anchord::sql {
namespace {

constexpr int k_busy_timeout_ms = 5000;
/// Rows of one INSERT: what a statement costs besides its rows is then 2 % of what it was, and the parameters
/// of the widest table are far from SQLite's limit of 32 766.
constexpr std::size_t k_rows_together = 50;

// A quota or a limit on the file size is, for whoever has to help, the same as a full disk.
bool means_no_space(int system_errno) {
  return system_errno == ENOSPC || system_errno == EDQUOT || system_errno == EFBIG;
}

// sqlite3_system_errno is often 0 by the time it can be asked; the files remember their own last one.
int last_system_errno(sqlite3* db) {
  int found = sqlite3_system_errno(db);
  for (const int which : {SQLITE_FCNTL_JOURNAL_POINTER, SQLITE_FCNTL_FILE_POINTER}) {
    sqlite3_file* file = nullptr;
    if (found != 0 || sqlite3_file_control(db, "main", which, static_cast<void*>(&file)) != SQLITE_OK)
      continue;
    if (file != nullptr && file->pMethods != nullptr)
      file->pMethods->xFileControl(file, SQLITE_FCNTL_LAST_ERRNO, &found);
  }
  return found;
}

Failure classify(int code, int system_errno) {
  switch (code & 0xff) {
    case SQLITE_FULL:
      return Failure::full;
    case SQLITE_IOERR:
      return means_no_space(system_errno) ? Failure::full : Failure::unavailable;
    case SQLITE_CANTOPEN:
      return means_no_space(system_errno) ? Failure::full : Failure::unavailable;
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_PROTOCOL:
      return Failure::unavailable;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return Failure::damaged;
    case SQLITE_CONSTRAINT:
      return Failure::constraint;
    default:
      return Failure::internal;
  }
}

SqlError to_sql_error(const SQLite::Exception& error, sqlite3* db) {
  const int code = error.getExtendedErrorCode() > 0 ? error.getExtendedErrorCode() : error.getErrorCode();
  const int system_errno = db != nullptr ? last_system_errno(db) : 0;
  std::string text = std::string("database: ") + error.what();
  const Failure failure = classify(code, system_errno);
  if (failure == Failure::unavailable || failure == Failure::full) {
    text += " (code " + std::to_string(code);
    if ((code & 0xff) == SQLITE_IOERR && system_errno != 0)
      text += std::string(", ") + std::strerror(system_errno);
    text += ")";
  }
  return {failure, text};
}

class SqliteStatement final : public Statement {
 public:
  SqliteStatement(SQLite::Database& db, const std::string& sql) : db_(db.getHandle()), statement_(db, sql) {}
  void bind_null(int index) override {
    guard([&] { statement_.bind(index); });
  }
  void bind_integer(int index, std::int64_t value) override {
    guard([&] { statement_.bind(index, value); });
  }
  void bind_real(int index, double value) override {
    guard([&] { statement_.bind(index, value); });
  }
  void bind_text(int index, std::string_view value) override {
    guard([&] { statement_.bind(index, std::string(value)); });
  }
  void bind_blob(int index, std::span<const std::byte> value) override {
    // A null pointer would bind NULL; an empty blob is a value.
    guard([&] {
      statement_.bind(index, value.empty() ? static_cast<const void*>("") : value.data(),
                      static_cast<int>(value.size()));
    });
  }
  bool step() override {
    bool row = false;
    guard([&] { row = statement_.executeStep(); });
    return row;
  }
  std::optional<std::int64_t> insert(std::string_view) override {
    while (step()) {
    }
    if (sqlite3_changes(db_) == 0) return std::nullopt;
    return sqlite3_last_insert_rowid(db_);
  }
  void reset() noexcept override { statement_.tryReset(); }
  bool is_null(int column) override { return statement_.isColumnNull(column); }
  std::int64_t integer(int column) override { return statement_.getColumn(column).getInt64(); }
  double real(int column) override { return statement_.getColumn(column).getDouble(); }
  std::string text(int column) override { return statement_.getColumn(column).getString(); }
  std::span<const std::byte> blob(int column) override {
    const auto value = statement_.getColumn(column);
    return {static_cast<const std::byte*>(value.getBlob()), static_cast<std::size_t>(value.getBytes())};
  }

 private:
  template <class F>
  void guard(F&& f) {
    try {
      f();
    } catch (const SQLite::Exception& error) {
      throw to_sql_error(error, db_);
    }
  }
  sqlite3* db_;
  SQLite::Statement statement_;
};

int open_flags(SqliteConnection::Mode mode) {
  switch (mode) {
    case SqliteConnection::Mode::read_only:
      return SQLite::OPEN_READONLY | SQLite::OPEN_NOMUTEX;
    case SqliteConnection::Mode::inspect:
    case SqliteConnection::Mode::read_write:
      return SQLite::OPEN_READWRITE | SQLite::OPEN_NOMUTEX;
    case SqliteConnection::Mode::create:
      return SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_NOMUTEX;
  }
  return SQLite::OPEN_READONLY | SQLite::OPEN_NOMUTEX;
}

/// SQLite's sums of its memory take one mutex of the whole process at every allocation, and nobody reads
/// them. Refused, and no harm, where another library has begun with SQLite before.
void count_no_memory() {
  static const int once = sqlite3_config(SQLITE_CONFIG_MEMSTATUS, 0);
  static_cast<void>(once);
}

/// A prepared statement is found by its text without a copy of that.
}  // namespace

struct SqliteConnection::State {
  State(const std::filesystem::path& file, int flags) : db(file.string(), flags, k_busy_timeout_ms) {}
  SQLite::Database db;
  std::unordered_map<std::string, std::unique_ptr<SqliteStatement>, TextHash, std::equal_to<>> statements;
  int wal_pages{0};
};

SqliteConnection::SqliteConnection(const std::filesystem::path& file, Mode mode, Synchronous synchronous,
                                   std::optional<std::uint32_t> max_pages) {
  count_no_memory();
  try {
    state_ = std::make_unique<State>(file, open_flags(mode));
  } catch (const SQLite::Exception& error) {
    throw SqlError(
        classify(error.getExtendedErrorCode() > 0 ? error.getExtendedErrorCode() : error.getErrorCode(), 0),
        "database: " + file.string() + ": " + error.what());
  }
  sqlite3_extended_result_codes(handle(), 1);
  sqlite3_db_config(handle(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle(), SQLITE_DBCONFIG_DQS_DML, 0, nullptr);
  sqlite3_db_config(handle(), SQLITE_DBCONFIG_DQS_DDL, 0, nullptr);
  execute("PRAGMA trusted_schema=OFF");
  execute("PRAGMA cell_size_check=ON");
  // A stray pointer or an I/O error on mapped pages is damage or a signal; read() gives an error.
  execute("PRAGMA mmap_size=0");
  execute("PRAGMA foreign_keys=ON");
  if (mode == Mode::read_only || mode == Mode::inspect) {
    execute("PRAGMA query_only=ON");
    return;
  }
  if (mode == Mode::create) execute("PRAGMA page_size=8192");
  execute("PRAGMA journal_mode=WAL");
  execute("PRAGMA synchronous=" + to_string(synchronous));
  // Checkpoints are run by the writer's thread alone: SQLite up to 3.51.2 has a rare race between two that
  // do.
  execute("PRAGMA wal_autocheckpoint=0");
  execute("PRAGMA journal_size_limit=67108864");
  execute("PRAGMA cache_size=-8192");
  // Savepoints keep the pages they would undo; in a file they cost more than the rows themselves.
  execute("PRAGMA temp_store=MEMORY");
  if (max_pages) execute("PRAGMA max_page_count=" + std::to_string(*max_pages));
  sqlite3_wal_hook(
      handle(),
      [](void* pages, sqlite3*, const char*, int count) {
        *static_cast<int*>(pages) = count;
        return SQLITE_OK;
      },
      &state_->wal_pages);
}

SqliteConnection::~SqliteConnection() {
  state_->statements.clear();  // before the database they belong to
}

Statement& SqliteConnection::prepared(std::string_view sql) {
  auto it = state_->statements.find(sql);
  if (it == state_->statements.end()) {
    try {
      std::string text(sql);
      auto statement = std::make_unique<SqliteStatement>(state_->db, text);
      it = state_->statements.emplace(std::move(text), std::move(statement)).first;
    } catch (const SQLite::Exception& error) {
      throw to_sql_error(error, handle());
    }
  }
  return *it->second;
}

void SqliteConnection::execute(const std::string& sql) {
  try {
    state_->db.exec(sql);
  } catch (const SQLite::Exception& error) {
    throw to_sql_error(error, handle());
  }
}

Connection::Keys SqliteConnection::insert_rows(const BulkTable& table, std::size_t n, const BindRow& bind) {
  Keys keys;
  if (!table.key.empty()) keys.reserve(n);
  std::size_t from = 0;
  if (n >= k_rows_together) {
    // Without ON CONFLICT it fails as a whole where there is a row like one of them.
    Query query(*this, insert_text(table, k_rows_together));
    for (; n - from >= k_rows_together; from += k_rows_together) {
      query.again();
      for (std::size_t row = from; row < from + k_rows_together; ++row) bind(query, row);
      if (insert_together(query, table, k_rows_together, keys)) continue;
      query.again();
      for (const auto& key : Connection::insert_rows(
               table, k_rows_together, [&](Query&one, std::size_t row) { bind(one, from + row); }))
        keys.push_back(key);
    }
  }
  for (const auto& key :
       Connection::insert_rows(table, n - from, [&](Query&one, std::size_t row) { bind(one, from + row); }))
    keys.push_back(key);
  return keys;
}

/// False, and nothing is inserted, where there is a row like one of these: only one at a time do they say
/// which.
bool SqliteConnection::insert_together(Query& query, const BulkTable& table, std::size_t n, Keys& keys) {
  try {
    query.run();
  } catch (const SqlError& error) {
    if (table.key.empty() || error.failure() != Failure::constraint) throw;
    return false;
  }
  if (table.key.empty()) return true;
  // Keys that SQLite gives out are one more than the largest, row after row.
  const std::int64_t last = sqlite3_last_insert_rowid(handle());
  for (std::size_t row = 1; row <= n; ++row)
    keys.emplace_back(last - static_cast<std::int64_t>(n) + static_cast<std::int64_t>(row));
  return true;
}

std::int64_t SqliteConnection::pragma(const std::string& name) {
  Query query(*this, "PRAGMA " + name);
  return query.step() ? query.integer() : 0;
}

bool SqliteConnection::read_only_file() { return sqlite3_db_readonly(handle(), "main") != 0; }

bool SqliteConnection::in_transaction() { return sqlite3_get_autocommit(handle()) == 0; }

int SqliteConnection::wal_pages() const { return state_->wal_pages; }

void SqliteConnection::checkpoint_passive() {
  int log = 0;
  int done = 0;
  const int code = sqlite3_wal_checkpoint_v2(handle(), nullptr, SQLITE_CHECKPOINT_PASSIVE, &log, &done);
  // Busy: a reader still needs the old pages; the next time will do.
  if (code != SQLITE_OK && (code & 0xff) != SQLITE_BUSY) {
    throw SqlError(classify(code, last_system_errno(handle())),
                   std::string("database: checkpoint: ") + sqlite3_errmsg(handle()));
  }
  if (done >= log) state_->wal_pages = 0;
}

std::string SqliteConnection::check(bool full) {
  std::string found;
  Query query(*this, full ? "PRAGMA integrity_check(10)" : "PRAGMA quick_check(10)");
  while (query.step()) found += (found.empty() ? "" : "; ") + query.text();
  return found;
}

sqlite3* SqliteConnection::handle() { return state_->db.getHandle(); }

}  // namespace anchord::sql
