#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/check.hpp"
#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/document.hpp"

namespace anchord {
struct StoredAnswer;
}

/// The seam between the stores and the database: stores are written once against it, each database implements
/// it once. SQL texts use ?1, ?2 ... in order, ON CONFLICT, RETURNING and ifnull, and nothing else that only
/// one database knows.
namespace anchord::sql {

enum class Failure : std::uint8_t {
  full,         ///< no space
  unavailable,  ///< I/O error, read-only, busy past the limit
  damaged,      ///< the file is not what it should be
  constraint,   ///< a rule of the schema; the caller's data, not the database
  contended,    ///< undone because of another transaction: the same work may succeed when it is run again
  internal,     ///< our SQL is wrong
};

/// Thrown inside server/storage only; the write queue and the reader pool turn it into an Error.
class SqlError : public std::exception {
 public:
  SqlError(Failure failure, std::string text) : failure_(failure), text_(std::move(text)) {}
  Failure failure() const { return failure_; }
  const char* what() const noexcept override { return text_.c_str(); }

 private:
  Failure failure_;
  std::string text_;  // its own: a copy is kept for other threads, and runtime_error's copies share theirs
};

Error to_error(const SqlError& error);

/// A prepared statement. Parameters count from 1, columns from 0. What is bound is copied.
class Statement {
 public:
  virtual ~Statement() = default;
  virtual void bind_null(int index) = 0;
  virtual void bind_integer(int index, std::int64_t value) = 0;
  virtual void bind_real(int index, double value) = 0;
  virtual void bind_text(int index, std::string_view value) = 0;
  virtual void bind_blob(int index, std::span<const std::byte> value) = 0;
  virtual bool step() = 0;  ///< true: a row
  /// Runs an INSERT of one row, which says no RETURNING: its `key`, the table's integer key, or nothing where
  /// ON CONFLICT DO NOTHING left it out. In SQLite a RETURNING says the same at three times the cost.
  virtual std::optional<std::int64_t> insert(std::string_view key) = 0;
  virtual void reset() noexcept = 0;
  virtual bool is_null(int column) = 0;
  virtual std::int64_t integer(int column) = 0;
  virtual double real(int column) = 0;
  virtual std::string text(int column) = 0;
  virtual std::span<const std::byte> blob(int column) = 0;  ///< until the next step or reset
};

class Query;

/// A table that takes many rows in one call.
struct BulkTable {
  std::string_view name;
  std::string_view columns;  ///< "a, b, c", in the order in which they are bound
  std::string_view key{};    ///< integer key that the database gives out; empty: there is none
};

/// "INSERT INTO t (a, b) VALUES (?1, ?2), (?3, ?4)": so many rows of the table.
std::string insert_text(const BulkTable& table, std::size_t n_rows);

/// One connection, used by one thread at a time.
class Connection {
 public:
  virtual ~Connection() = default;
  /// Prepared once per text and kept.
  virtual Statement& prepared(std::string_view sql) = 0;
  virtual void execute(const std::string& sql) = 0;

  using BindRow = std::function<void(Query&, std::size_t row)>;
  using Keys = std::vector<std::optional<std::int64_t>>;
  /// Inserts `n` rows. With a key: the key of each, or nothing for one that is left out because there is one
  /// like it, also among these. Without a key: a row that is there already is an error, nothing is answered.
  /// One statement a row; each database has a faster way for many.
  virtual Keys insert_rows(const BulkTable& table, std::size_t n, const BindRow& bind);
};

/// A statement in use: bind with <<, step, take columns in order; resets itself.
class Query {
 public:
  Query(Connection& connection, std::string_view sql) : Query(connection.prepared(sql)) {}
  explicit Query(Statement& statement) : statement_(statement) {}
  ~Query() { statement_.reset(); }
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;

  /// Ready for the next set of parameters; every one must be bound again.
  void again() {
    statement_.reset();
    parameter_ = 1;
  }
  bool step() {
    column_ = 0;
    return statement_.step();
  }
  void run() {
    while (step()) {
    }
  }

  /// Of a table with an integer key: that of the row inserted, or nothing where there is one like it.
  std::optional<std::int64_t> inserted(std::string_view key) { return statement_.insert(key); }

  /// The integer of a RETURNING; nothing when no row was touched. Runs to the end, where foreign keys are
  /// judged.
  std::optional<std::int64_t> returned() {
    if (!step()) return std::nullopt;
    const std::int64_t value = integer();
    run();
    return value;
  }

  Query& operator<<(std::nullopt_t) {
    statement_.bind_null(parameter_++);
    return *this;
  }
  Query& operator<<(std::int64_t v) {
    statement_.bind_integer(parameter_++, v);
    return *this;
  }
  Query& operator<<(int v) { return *this << std::int64_t{v}; }
  Query& operator<<(bool v) { return *this << std::int64_t{v}; }
  Query& operator<<(std::uint8_t v) { return *this << std::int64_t{v}; }
  Query& operator<<(std::uint64_t v) { return *this << static_cast<std::int64_t>(v); }
  Query& operator<<(double v) {
    statement_.bind_real(parameter_++, v);
    return *this;
  }
  Query& operator<<(std::string_view v) {
    statement_.bind_text(parameter_++, v);
    return *this;
  }
  Query& operator<<(const std::string& v) { return *this << std::string_view{v}; }
  Query& operator<<(const Document& v) { return *this << v.text; }
  Query& operator<<(const char* v) { return *this << std::string_view{v}; }
  Query& operator<<(std::span<const std::byte> v) {
    statement_.bind_blob(parameter_++, v);
    return *this;
  }
  Query& operator<<(UtcTime v) { return *this << v.ns; }
  Query& operator<<(NetworkId v) { return *this << std::int64_t{v.value}; }
  template <class Tag>
  Query& operator<<(const Id<Tag>& v) {
    return *this << std::as_bytes(std::span{v.uuid.bytes});
  }
  template <class T>
  Query& operator<<(const std::optional<T>& v) {
    return v ? *this << *v : *this << std::nullopt;
  }

  std::int64_t integer() { return statement_.integer(column_++); }
  template <class T>
  T as() {
    static_assert(!std::is_enum_v<T>, "read an enum with one_of()");
    return static_cast<T>(integer());
  }
  /// The value of an enum that is kept as its number.
  template <class T, std::size_t N>
  T one_of(const EnumTable<T, N>& table) {
    const std::int64_t number = integer();
    const auto value = table.of_number(number);
    ANCHORD_CHECK(value, "the database has " << number << " where there are " << list_of(table.words()));
    return *value;
  }
  double real();  ///< NaN for NULL, which is how the database keeps a NaN
  std::string text() { return statement_.text(column_++); }
  Document document() { return {text()}; }
  std::span<const std::byte> blob() { return statement_.blob(column_++); }
  UtcTime time() { return {integer()}; }
  NetworkId network_id() { return {static_cast<std::uint32_t>(integer())}; }
  template <class AnyId>
  AnyId id() {
    return AnyId{uuid()};
  }
  bool null() { return statement_.is_null(column_); }
  void skip(int columns = 1) { column_ += columns; }
  /// The next column, or nothing when NULL: q.maybe([&] { return q.real(); }).
  template <class F>
  auto maybe(F&& take) -> std::optional<decltype(take())> {
    if (null()) {
      skip();
      return std::nullopt;
    }
    return std::forward<F>(take)();
  }
  std::optional<double> maybe_real() {
    return maybe([&] { return real(); });
  }
  std::optional<UtcTime> maybe_time() {
    return maybe([&] { return time(); });
  }

 private:
  Uuid uuid();

  Statement& statement_;
  int parameter_{1};
  int column_{0};
};

/// Something to do on a connection inside a transaction; an Error undoes it. May run again from the start, so
/// it sets its results only by overwriting.
using Work = std::function<std::optional<Error>(Connection&)>;

/// Where a store sends its work. Callable from any thread; both calls block until done.
class Gate {
 public:
  virtual ~Gate() = default;
  /// Returns after the commit. `rows` is the weight in the bounded queue.
  virtual std::optional<Error> write(std::size_t rows, const Work& work) = 0;
  /// One consistent snapshot.
  virtual std::optional<Error> read(const Work& work) = 0;

  /// Another number once anything but appended measurements was written; none where others write as well.
  virtual std::optional<std::uint64_t> changes() const { return std::nullopt; }
  /// After the commit, before whoever asked for it is answered.
  void changed() { changes_.fetch_add(1, std::memory_order_acq_rel); }

 protected:
  std::uint64_t counted_changes() const { return changes_.load(std::memory_order_acquire); }

 private:
  std::atomic<std::uint64_t> changes_{0};
};

/// `work`, and in its transaction the mark of the request that this thread writes for, where there is one
/// (core/ports/request_mark.hpp).
Work marked(Work work);
/// False where the principal has a younger answer under this key.
bool put_answer(Connection& c, const StoredAnswer& answer, std::int64_t expired_ran_ns);

/// Runs `work` (Connection& -> Result<T>) through the gate.
template <class T, class F>
Result<T> write_value(Gate& gate, std::size_t rows, F work) {
  std::optional<T> value;
  auto error = gate.write(rows, marked([&](Connection& c) -> std::optional<Error> {
                            Result<T> result = work(c);
                            if (!result) return result.error();
                            value = std::move(result).value();
                            return std::nullopt;
                          }));
  gate.changed();
  if (error) return *std::move(error);
  return *std::move(value);
}

template <class T, class F>
Result<T> read_value(Gate& gate, F work) {
  std::optional<T> value;
  auto error = gate.read([&](Connection& c) -> std::optional<Error> {
    Result<T> result = work(c);
    if (!result) return result.error();
    value = std::move(result).value();
    return std::nullopt;
  });
  if (error) return *std::move(error);
  return *std::move(value);
}

template <class AnyId>
Error absent(const char* what, const AnyId& id) {
  return make_error(Errc::not_found, std::string("no ") + what + ' ' + to_string(id));
}
/// A change named a version that is no longer the newest.
inline Error moved_on(const std::string& what, std::uint64_t expected, std::uint64_t stored) {
  return make_error(Errc::conflict,
                    what + " is at version " + std::to_string(stored) + ", not " + std::to_string(expected));
}

/// For work without a value.
Result<void> write_void(Gate& gate, const Work& work, std::size_t rows = 1);

}  // namespace anchord::sql
