#include "server/storage/postgres_connection.hpp"

#include <libpq-fe.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <unordered_map>
#include <vector>

#include "server/storage/postgres_arrays.hpp"
#include "server/storage/postgres_text.hpp"
#include "server/storage/text_hash.hpp"

namespace anchord::sql {
namespace {

/// Older ones are not tried.
constexpr int k_least_version = 150000;
constexpr int k_binary = 1;

struct Clear {
  void operator()(PGresult* result) const { PQclear(result); }
};
using Answer = std::unique_ptr<PGresult, Clear>;
struct Finish {
  void operator()(PGconn* connection) const { PQfinish(connection); }
};

/// By SQLSTATE; empty where there was no server to say one.
Failure classify(std::string_view state) {
  const auto in = [&](auto... one) { return ((state == one) || ...); };
  const std::string_view group = state.substr(0, std::min<std::size_t>(2, state.size()));
  if (in("40001", "40P01")) return Failure::contended;
  if (in("53100")) return Failure::full;
  if (in("XX001", "XX002")) return Failure::damaged;
  // Bytes that are no text, a number too large, a name too long for an index: the caller's data.
  if (group == "23" || in("P0001", "22021", "22P05", "22003", "22001", "54000")) return Failure::constraint;
  // Time-outs, locks, a standby that only reads (in two ways), a lack of rights, a disk that fails.
  if (state == "AN001") return Failure::unavailable;  // assert_server: taken over from
  if (in("57014", "55P03", "25006", "25P03", "42501", "58030", "58000", "0A000")) return Failure::unavailable;
  if (state.empty() || group == "08" || group == "53" || group == "57" || group == "28" || group == "3D")
    return Failure::unavailable;
  return Failure::internal;
}

/// libpq's messages end with a new line, and the rest of a long one are hints.
std::string first_line(const char* text) {
  const std::string_view all = text == nullptr ? "" : text;
  return std::string(all.substr(0, all.find('\n')));
}

SqlError failed(PGconn* connection, const PGresult* result) {
  const char* state = result == nullptr ? nullptr : PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view known = state == nullptr ? "" : state;
  const bool lost = PQstatus(connection) != CONNECTION_OK;
  std::string text =
      first_line(result == nullptr ? PQerrorMessage(connection) : PQresultErrorMessage(result));
  if (text.empty()) text = first_line(PQerrorMessage(connection));
  return {lost ? Failure::unavailable : classify(known),
          "database: " + text + (known.empty() ? "" : " (" + std::string(known) + ")")};
}

void check(PGconn* connection, const PGresult* result) {
  const ExecStatusType status = PQresultStatus(result);
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) throw failed(connection, result);
}

std::uint64_t big_endian(const char* bytes, int n) {
  std::uint64_t value = 0;
  for (int i = 0; i < n; ++i) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

/// What the server has parsed last without giving it a name: it stays until another text comes, or a command
/// of execute(), which every transaction begins with.
struct Parsed {
  const Statement* statement{nullptr};
};

class PostgresStatement final : public Statement {
 public:
  PostgresStatement(PGconn* connection, Parsed& parsed, std::string_view sql)
      : connection_(connection), parsed_(parsed), text_(sql) {
    parameters_.resize(static_cast<std::size_t>(text_.parameters()));
  }

  void bind_null(int index) override { at(index) = {}; }
  void bind_integer(int index, std::int64_t value) override {
    Parameter& to = fresh(index, k_int8);
    put_big_endian(to.own, static_cast<std::uint64_t>(value));
  }
  void bind_real(int index, double value) override {
    // As SQLite does it: a NaN is kept as NULL.
    if (std::isnan(value)) return bind_null(index);
    Parameter& to = fresh(index, k_float8);
    put_big_endian(to.own, std::bit_cast<std::uint64_t>(value));
  }
  void bind_text(int index, std::string_view value) override { fresh(index, k_text).own = value; }
  void bind_blob(int index, std::span<const std::byte> value) override {
    fresh(index, k_bytea).own.assign(reinterpret_cast<const char*>(value.data()), value.size());
  }

  /// In PostgreSQL's binary form; must live until reset.
  void bind_binary(int index, unsigned type, std::string_view value) {
    fresh(index, type).borrowed = std::as_bytes(std::span{value});
  }

  bool step() override {
    if (!ran_) run("");
    return ++row_ < PQntuples(result_.get());
  }
  std::optional<std::int64_t> insert(std::string_view key) override {
    run(" RETURNING " + std::string(key));
    row_ = 0;
    if (PQntuples(result_.get()) == 0) return std::nullopt;
    return integer(0);
  }
  void reset() noexcept override {
    result_.reset();
    ran_ = false;
    row_ = -1;
  }

  bool is_null(int column) override { return PQgetisnull(result_.get(), row_, column) != 0; }
  std::int64_t integer(int column) override {
    if (is_null(column)) return 0;
    switch (PQftype(result_.get(), column)) {
      case k_int8:
        return static_cast<std::int64_t>(big_endian(sized(column, 8), 8));
      case k_int4:
        return static_cast<std::int32_t>(big_endian(sized(column, 4), 4));
      case k_int2:
        return static_cast<std::int16_t>(big_endian(sized(column, 2), 2));
      case k_bool:
        return *sized(column, 1);
      default:
        throw unexpected(column, "an integer");
    }
  }
  double real(int column) override {
    if (is_null(column)) return 0;
    if (PQftype(result_.get(), column) != k_float8) return static_cast<double>(integer(column));
    return std::bit_cast<double>(big_endian(sized(column, 8), 8));
  }
  std::string text(int column) override {
    if (PQftype(result_.get(), column) != k_text) throw unexpected(column, "a text");
    return {PQgetvalue(result_.get(), row_, column), length(column)};
  }
  std::span<const std::byte> blob(int column) override {
    if (PQftype(result_.get(), column) != k_bytea) throw unexpected(column, "a blob");
    return std::as_bytes(std::span{PQgetvalue(result_.get(), row_, column), length(column)});
  }

 private:
  struct Parameter {
    Oid type{0};  ///< 0: NULL
    std::string own;
    std::span<const std::byte> borrowed;
    const char* data() const {
      // A null pointer would be NULL; an empty value is one.
      if (borrowed.data() == nullptr) return own.data();
      return reinterpret_cast<const char*>(borrowed.data());
    }
    std::size_t size() const { return borrowed.data() == nullptr ? own.size() : borrowed.size(); }
  };

  Parameter& at(int index) {
    if (index < 1 || static_cast<std::size_t>(index) > parameters_.size())
      throw SqlError(Failure::internal, "database: a statement has no parameter " + std::to_string(index));
    return parameters_[static_cast<std::size_t>(index - 1)];
  }
  Parameter& fresh(int index, Oid type) {
    Parameter& parameter = at(index);
    parameter.type = type;
    parameter.own.clear();
    parameter.borrowed = {};
    return parameter;
  }

  void run(const std::string& behind) {
    const std::size_t n = parameters_.size();
    auto types = std::vector<Oid>(n, k_int8);  // also of one that has no place in the text
    values_.assign(n, nullptr);
    lengths_.assign(n, 0);
    formats_.assign(n, k_binary);
    given_.assign(n, false);
    bool all = true;
    for (std::size_t i = 0; i < n; ++i) {
      const Parameter& one = parameters_[i];
      given_[i] = one.type != 0;
      all = all && given_[i];
      if (!given_[i]) continue;
      if (one.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
        throw SqlError(Failure::constraint, "database: a value of more than 2 GiB");
      types[i] = one.type;
      values_[i] = one.data();
      lengths_[i] = static_cast<int>(one.size());
    }
    std::string text = (all ? text_.whole() : text_.with(given_)) + behind;
    const bool again = parsed_.statement == this && text == sent_ && types == types_;
    if (!again) {
      sent_ = std::move(text);
      types_ = std::move(types);
    }
    parsed_.statement = this;
    const int count = static_cast<int>(n);
    result_.reset(again ? PQexecPrepared(connection_, "", count, values_.data(), lengths_.data(),
                                         formats_.data(), k_binary)
                        : PQexecParams(connection_, sent_.c_str(), count, types_.data(), values_.data(),
                                       lengths_.data(), formats_.data(), k_binary));
    check(connection_, result_.get());
    ran_ = true;
    row_ = -1;
  }

  std::size_t length(int column) const {
    return static_cast<std::size_t>(PQgetlength(result_.get(), row_, column));
  }
  const char* sized(int column, std::size_t bytes) const {
    if (length(column) != bytes) throw unexpected(column, std::to_string(bytes) + " bytes");
    return PQgetvalue(result_.get(), row_, column);
  }
  SqlError unexpected(int column, const std::string& wanted) const {
    return {Failure::internal, "database: column " + std::to_string(column) + " is not " + wanted +
                                   " but of type " + std::to_string(PQftype(result_.get(), column))};
  }

  PGconn* connection_;
  Parsed& parsed_;
  const PostgresText text_;
  std::string sent_;  ///< the newest that was parsed, with types_
  std::vector<Parameter> parameters_;
  // What libpq wants of the parameters, side by side.
  std::vector<Oid> types_;
  std::vector<const char*> values_;
  std::vector<int> lengths_, formats_;
  PostgresText::Given given_;
  Answer result_;
  bool ran_{false};
  int row_{-1};
};

/// Where a password was wanted: the message alone does not say where it is to be written.
std::string password_advice(const PGconn* connection) {
  if (PQconnectionNeedsPassword(connection) == 0 && PQconnectionUsedPassword(connection) == 0) return {};
  return "; the password is read from ~/.pgpass, or from the file (mode 0600) in PGPASSFILE";
}

/// Fewer rows are not worth a statement of arrays; more at once only cost memory.
constexpr std::size_t k_few_rows = 3, k_most_array_rows = 5000, k_most_array_bytes = 8u << 20;

/// "a, b, c" apart.
std::vector<std::string_view> split_columns(std::string_view columns) {
  std::vector<std::string_view> out;
  for (std::size_t at = 0; at < columns.size();) {
    const auto end = std::min(columns.find(", ", at), columns.size());
    out.push_back(columns.substr(at, end - at));
    at = end + 2;
  }
  return out;
}

/// A statement is found by its text without a copy of that.
/// PostgreSQL ends its wait for a synchronous standby at a time limit, and reports that as a warning of a
/// commit that went well: the rows are on its own disk only, and gone where that standby becomes the primary.
void note_warning(void* warned, const PGresult* notice) {
  const char* state = PQresultErrorField(notice, PG_DIAG_SQLSTATE);
  if (state != nullptr && std::string_view(state).starts_with("01")) *static_cast<bool*>(warned) = true;
}

/// The address may say otherwise: it stands behind these.
PGconn* connect(const std::string& address, const char* name, const PostgresConnection::Patience& patience) {
  constexpr std::array keywords{"connect_timeout",
                                "tcp_user_timeout",
                                "keepalives_idle",
                                "keepalives_interval",
                                "keepalives_count",
                                "fallback_application_name",
                                "dbname",
                                "client_encoding",
                                static_cast<const char*>(nullptr)};
  const std::array values{patience.connect_s,
                          patience.unacknowledged_ms,
                          "10",
                          "5",
                          "3",
                          name,
                          address.c_str(),
                          "UTF8",
                          static_cast<const char*>(nullptr)};
  static_assert(keywords.size() == std::tuple_size_v<decltype(values)>);
  return PQconnectdbParams(keywords.data(), values.data(), 1);
}

}  // namespace

struct PostgresConnection::State {
  State(const std::string& address, const char* name, const Patience& patience)
      : connection(connect(address, name, patience)) {}
  PGconn* get() const { return connection.get(); }
  bool warned{false};  ///< by what is executed; outlives the connection, which writes it
  std::unique_ptr<PGconn, Finish> connection;
  Parsed parsed;
  std::unordered_map<std::string, std::unique_ptr<PostgresStatement>, TextHash, std::equal_to<>> statements;
};

PostgresConnection::PostgresConnection(const std::string& address, const char* name, const Patience& patience)
    : state_(std::make_unique<State>(address, name, patience)) {
  PGconn* const c = state_->get();
  if (c == nullptr) throw SqlError(Failure::unavailable, "database: no memory for a connection");
  const std::string where = "database " + shown_address(address) + ": ";
  if (PQstatus(c) != CONNECTION_OK)
    throw SqlError(Failure::unavailable, where + first_line(PQerrorMessage(c)) + password_advice(c));
  PQsetNoticeReceiver(c, note_warning, &state_->warned);  // libpq's own writes to the terminal
  if (PQserverVersion(c) < k_least_version)
    throw SqlError(Failure::unavailable, where + "this is PostgreSQL " +
                                             std::to_string(PQserverVersion(c) / 10000) +
                                             "; anchord needs 15 or newer");
  const char* encoding = PQparameterStatus(c, "server_encoding");
  if (encoding == nullptr || std::string_view(encoding) != "UTF8")
    throw SqlError(Failure::unavailable,
                   where + "its encoding is " + (encoding == nullptr ? "?" : encoding) +
                       "; create one with: createdb --encoding=UTF8 --template=template0");
}

PostgresConnection::~PostgresConnection() {
  state_->statements.clear();  // before the connection they belong to
}

Statement& PostgresConnection::prepared(std::string_view sql) {
  auto it = state_->statements.find(sql);
  if (it == state_->statements.end()) {
    auto statement = std::make_unique<PostgresStatement>(state_->get(), state_->parsed, sql);
    it = state_->statements.emplace(std::string(sql), std::move(statement)).first;
  }
  return *it->second;
}

void PostgresConnection::execute(const std::string& sql) {
  state_->parsed = {};
  const Answer answer(PQexec(state_->get(), sql.c_str()));
  check(state_->get(), answer.get());
}

Connection::Keys PostgresConnection::insert_rows(const BulkTable& table, std::size_t n, const BindRow& bind) {
  if (n <= k_few_rows) return Connection::insert_rows(table, n, bind);
  PostgresArrays arrays(split_columns(table.columns).size());
  Query row(arrays);
  Keys keys;
  for (std::size_t at = 0; at < n;) {
    arrays.clear();
    const std::size_t first = at;
    while (at < n && at - first < k_most_array_rows && arrays.bytes() < k_most_array_bytes) {
      row.again();
      bind(row, at++);
    }
    insert_arrays(table, arrays, at - first, keys);
  }
  return keys;
}

/// Keys are drawn before, for RETURNING does not tell which of the rows it is about. A row that is there
/// already is rare, and looking for one with every row costs a third: first as if there were none.
void PostgresConnection::insert_arrays(const BulkTable& table, PostgresArrays& arrays, std::size_t n,
                                       Keys& keys) {
  if (table.key.empty()) return void(insert_arrays(table, arrays, {}, ""));
  const auto drawn = draw_keys(table, n);
  execute("SAVEPOINT bulk");
  try {
    insert_arrays(table, arrays, drawn, "");
    execute("RELEASE SAVEPOINT bulk");
    keys.insert(keys.end(), drawn.begin(), drawn.end());
    return;
  } catch (const SqlError& error) {
    if (error.failure() != Failure::constraint) throw;
  }
  execute("ROLLBACK TO SAVEPOINT bulk; RELEASE SAVEPOINT bulk");
  const auto taken =
      insert_arrays(table, arrays, drawn, " ON CONFLICT DO NOTHING RETURNING " + std::string(table.key));
  for (const auto key : drawn)
    keys.push_back(std::ranges::binary_search(taken, key) ? std::optional(key) : std::nullopt);
}

std::vector<std::int64_t> PostgresConnection::insert_arrays(const BulkTable& table, PostgresArrays& arrays,
                                                            const std::vector<std::int64_t>& drawn,
                                                            const std::string& behind) {
  PostgresArrays of_keys(1);
  for (const auto key : drawn) of_keys.bind_integer(1, key);
  struct Given {
    unsigned type;
    std::string_view array;
  };
  std::vector<Given> given;
  std::string into, values, from, columns;
  const auto add = [&](std::string_view name, PostgresArrays& of, std::size_t column) {
    into.append(into.empty() ? "" : ", ").append(name);
    values.append(values.empty() ? "" : ", ");
    if (of.element(column) == 0) return void(values.append("NULL"));
    given.push_back({of.type(column), of.array(column)});
    const std::string number = std::to_string(given.size());
    values.append("c" + number);
    from.append(from.empty() ? "?" : ", ?").append(number);
    columns.append(columns.empty() ? "c" : ", c").append(number);
  };
  if (!drawn.empty()) add(table.key, of_keys, 0);
  std::size_t column = 0;
  for (const auto name : split_columns(table.columns)) add(name, arrays, column++);
  auto& statement = static_cast<PostgresStatement&>(prepared("INSERT INTO " + std::string(table.name) + " (" +
                                                             into + ") SELECT " + values + " FROM unnest(" +
                                                             from + ") AS r(" + columns + ")" + behind));
  Query query(statement);
  int parameter = 0;
  for (const Given& one : given) statement.bind_binary(++parameter, one.type, one.array);
  std::vector<std::int64_t> answered;
  while (query.step()) answered.push_back(query.integer());
  std::ranges::sort(answered);
  return answered;
}

std::vector<std::int64_t> PostgresConnection::draw_keys(const BulkTable& table, std::size_t n) {
  // OFFSET: the sequence is looked up once, not with every row.
  Query query(*this,
              "SELECT nextval(s.name) FROM (SELECT CAST(pg_get_serial_sequence(?1, ?2) AS regclass) AS name "
              "OFFSET 0) s, generate_series(1, ?3)");
  query << table.name << table.key << static_cast<std::int64_t>(n);
  std::vector<std::int64_t> keys;
  keys.reserve(n);
  while (query.step()) keys.push_back(query.integer());
  std::ranges::sort(keys);
  return keys;
}

bool PostgresConnection::usable() const { return PQstatus(state_->get()) == CONNECTION_OK; }

bool PostgresConnection::in_transaction() const {
  const auto status = PQtransactionStatus(state_->get());
  return status == PQTRANS_INTRANS || status == PQTRANS_INERROR;
}

void PostgresConnection::commit() {
  state_->parsed = {};
  state_->warned = false;
  const Answer answer(PQexec(state_->get(), "COMMIT"));
  check(state_->get(), answer.get());
  if (std::string_view(PQcmdStatus(const_cast<PGresult*>(answer.get()))) != "COMMIT")
    throw SqlError(Failure::internal, "database: the transaction was rolled back instead of committed");
  if (state_->warned)
    throw SqlError(Failure::unavailable, "database: no synchronous standby has confirmed the commit in time");
}

}  // namespace anchord::sql
