#pragma once

#include <memory>
#include <string>

#include "server/storage/sql.hpp"

namespace anchord::sql {

class PostgresArrays;

/// One connection to PostgreSQL. Nothing of it outlives a transaction (no prepared statement has a name, no
/// setting stays), so that a pooler may give every transaction another session. A result is in memory whole
/// before its first row is read.
class PostgresConnection final : public Connection {
 public:
  /// How long packets may stay without an acknowledgement before the connection is given up, and what a new
  /// one waits for each host; an address may give others.
  struct Patience {
    const char *unacknowledged_ms, *connect_s;
  };
  static constexpr Patience k_usual{"10000", "5"};
  /// Blocks at most some seconds. Throws SqlError. name: of the session, where the address gives none
  explicit PostgresConnection(const std::string& address, const char* name = "anchord",
                              const Patience& patience = k_usual);
  ~PostgresConnection() override;

  Statement& prepared(std::string_view sql) override;
  void execute(const std::string& sql) override;
  /// One statement for thousands of rows, each column an array.
  Keys insert_rows(const BulkTable& table, std::size_t n, const BindRow& bind) override;

  bool usable() const;  ///< the server was there when it was last spoken to
  bool in_transaction() const;
  /// Throws also where PostgreSQL answers a COMMIT by undoing, or did not wait for its synchronous standby.
  void commit();

  struct State;  ///< of the .cpp file

 private:
  void insert_arrays(const BulkTable& table, PostgresArrays& arrays, std::size_t n, Keys& keys);
  /// Answers what `behind` returns, sorted.
  std::vector<std::int64_t> insert_arrays(const BulkTable& table, PostgresArrays& arrays,
                                          const std::vector<std::int64_t>& drawn, const std::string& behind);
  std::vector<std::int64_t> draw_keys(const BulkTable& table, std::size_t n);

  std::unique_ptr<State> state_;
};

}  // namespace anchord::sql
