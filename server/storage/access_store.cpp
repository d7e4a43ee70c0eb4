#include <span>

#include "server/storage/migrate.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_answer =
    "SELECT idempotency_key, principal, request_sha256_hex, body, status, created_t_ns, location, etag "
    "FROM stored_answer WHERE principal = ?1 AND idempotency_key = ?2";
constexpr const char* k_access_keep =
    "INSERT INTO stored_answer (principal, idempotency_key, request_sha256_hex, status, body, created_t_ns, "
    "location, etag) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8) ON CONFLICT (principal, idempotency_key) DO "
    "UPDATE "
    "SET request_sha256_hex = excluded.request_sha256_hex, status = excluded.status, body = excluded.body, "
    "created_t_ns = excluded.created_t_ns, location = excluded.location, etag = excluded.etag "
    "WHERE stored_answer.created_t_ns < ?9 OR stored_answer.status = 0 RETURNING status";
constexpr const char* k_use =
    "SELECT count(*), ifnull(sum(length(body)), 0) FROM stored_answer WHERE principal = ?1";
constexpr const char* k_drop =
    "DELETE FROM stored_answer WHERE (principal, idempotency_key) IN (SELECT principal, idempotency_key FROM "
    "stored_answer WHERE created_t_ns < ?1 ORDER BY created_t_ns LIMIT ?2) RETURNING status";
constexpr const char* k_drop_oldest =
    "DELETE FROM stored_answer WHERE principal = ?1 AND idempotency_key IN (SELECT idempotency_key FROM "
    "stored_answer WHERE principal = ?1 ORDER BY created_t_ns LIMIT ?2) RETURNING status";
constexpr const char* k_newest_entry =
    "SELECT number, chain_sha256_hex FROM audit ORDER BY number DESC LIMIT 1";
constexpr const char* k_append =
    "INSERT INTO audit (number, t_ns, who, what, from_where, result, chain_sha256_hex) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)";
constexpr const char* k_access_entries =
    "SELECT t_ns, who, what, from_where, result FROM audit ORDER BY number DESC LIMIT ?1";
constexpr const char* k_chain =
    "SELECT number, t_ns, who, what, from_where, result, chain_sha256_hex FROM audit ORDER BY number";

AuditEntry read_entry(Query& query) {
  AuditEntry entry;
  entry.time = query.time();
  entry.who = query.text();
  entry.what = query.text();
  entry.from = query.text();
  entry.result = query.text();
  return entry;
}

/// Lengths before the texts, so that no two different entries give the same bytes.
std::string link(const std::string& before, std::int64_t number, const AuditEntry& entry) {
  std::string bytes = before + "|" + std::to_string(number) + "|" + std::to_string(entry.time.ns);
  for (const std::string* part : {&entry.who, &entry.what, &entry.from, &entry.result}) {
    bytes += "|" + std::to_string(part->size()) + ":" + *part;
  }
  return sha256_hex(bytes);
}

class SqlAccessStore final : public AccessStore {
 public:
  explicit SqlAccessStore(Gate& gate) : gate_(gate) {}

  Result<std::optional<StoredAnswer>> answer(std::string_view principal, std::string_view key) override {
    using Found = std::optional<StoredAnswer>;
    return read_value<Found>(gate_, [&](Connection& c) -> Result<Found> {
      Query query(c, k_answer);
      query << principal << key;
      if (!query.step()) return Found{};
      StoredAnswer found;
      found.key = query.text();
      found.principal = query.text();
      found.request_sha256_hex = query.text();
      const auto body = query.blob();
      for (const std::byte byte : body) found.body += static_cast<char>(byte);
      found.status = query.as<int>();
      found.created_ran_ns = query.integer();
      found.location = query.text();
      found.etag = query.text();
      return Found{std::move(found)};
    });
  }
  Result<void> keep_answer(const StoredAnswer& answer, std::int64_t expired_ran_ns) override {
    return unmarked([&](Connection& c) -> std::optional<Error> {
      if (put_answer(c, answer, expired_ran_ns)) return std::nullopt;
      return make_error(Errc::conflict, "an answer is kept under this key already");
    });
  }
  Result<AnswerUse> answer_use(std::string_view principal) override {
    return read_value<AnswerUse>(gate_, [&](Connection& c) -> Result<AnswerUse> {
      Query query(c, k_use);
      query << principal;
      AnswerUse use;
      if (query.step()) {
        use.count = query.as<std::size_t>();
        use.bytes = query.as<std::uint64_t>();
      }
      return use;
    });
  }
  Result<std::size_t> drop_answers_before(std::int64_t ran_ns, std::size_t most) override {
    return drop([&](Query& query) { query << ran_ns << row_limit(most); }, k_drop);
  }
  Result<std::size_t> drop_oldest_answers(std::string_view principal, std::size_t most) override {
    return drop([&](Query& query) { query << principal << row_limit(most); }, k_drop_oldest);
  }
  Result<void> append_audit(const AuditEntry& entry) override {
    return unmarked([&](Connection& c) -> std::optional<Error> {
      std::int64_t number = 0;
      std::string before;
      {
        Query newest(c, k_newest_entry);
        if (newest.step()) {
          number = newest.integer();
          before = newest.text();
        }
      }
      ++number;
      const std::string chain = link(before, number, entry);
      Query query(c, k_append);
      query << number << entry.time << entry.who << entry.what << entry.from << entry.result << chain;
      query.run();
      return std::nullopt;
    });
  }
  Result<std::vector<AuditEntry>> audit(std::size_t limit) override {
    return read_value<std::vector<AuditEntry>>(gate_, [&](Connection& c) -> Result<std::vector<AuditEntry>> {
      Query query(c, k_access_entries);
      query << row_limit(limit);
      std::vector<AuditEntry> found;
      while (query.step()) found.push_back(read_entry(query));
      return found;
    });
  }
  Result<void> verify_audit() override {
    if (auto error = gate_.read([](Connection& c) -> std::optional<Error> {
          Query query(c, k_chain);
          std::string before;
          std::int64_t expected = 1;
          while (query.step()) {
            const std::int64_t number = query.integer();
            const AuditEntry entry = read_entry(query);
            const std::string chain = query.text();
            if (number != expected || chain != link(before, number, entry)) {
              return make_error(Errc::conflict,
                                "the audit log was changed at entry " + std::to_string(expected));
            }
            before = chain;
            ++expected;
          }
          return std::nullopt;
        })) {
      return *std::move(error);
    }
    return boost::outcome_v2::success();
  }

 private:
  /// Of what is done for a request, neither its answer nor its line in the log is a part.
  Result<void> unmarked(const Work& work) {
    auto error = gate_.write(1, work);
    gate_.changed();
    if (error) return *std::move(error);
    return boost::outcome_v2::success();
  }
  template <class Bind>
  Result<std::size_t> drop(Bind bind, const char* text) {
    return write_value<std::size_t>(gate_, 1, [&](Connection& c) -> Result<std::size_t> {
      Query query(c, text);
      bind(query);
      std::size_t n = 0;
      while (query.step()) ++n;
      return n;
    });
  }
  Gate& gate_;
};

}  // namespace

bool put_answer(Connection& c, const StoredAnswer& answer, std::int64_t expired_ran_ns) {
  Query query(c, k_access_keep);
  query << answer.principal << answer.key << answer.request_sha256_hex << answer.status
        << std::as_bytes(std::span{answer.body}) << answer.created_ran_ns << answer.location << answer.etag
        << expired_ran_ns;
  return query.returned().has_value();
}

std::unique_ptr<AccessStore> make_access_store(Gate& gate) { return std::make_unique<SqlAccessStore>(gate); }

}  // namespace anchord::sql
