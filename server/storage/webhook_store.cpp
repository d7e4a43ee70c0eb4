#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_webhook_insert =
    "INSERT INTO webhook (id, name, url, secret, events, enabled, created_t_ns, version, kind, dialect, "
    "token) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)";
constexpr const char* k_webhook_update =
    "UPDATE webhook SET name = ?2, url = ?3, secret = ?4, events = ?5, enabled = ?6, version = ?7, "
    "dialect = ?9, token = ?10 WHERE id = ?1 AND version = ?8 RETURNING version";
constexpr const char* k_webhook_columns =
    "SELECT id, name, url, secret, events, enabled, created_t_ns, version, kind, dialect, token FROM "
    "webhook ";
constexpr const char* k_webhook_remove = "DELETE FROM webhook WHERE id = ?1 RETURNING webhook_key";
constexpr const char* k_add =
    "INSERT INTO webhook_delivery (id, webhook_key, event, body, state, created_t_ns, attempts, due_ran_ns, "
    "tried_t_ns, status, fault) SELECT ?1, webhook_key, ?3, ?4, ?5, ?6, ?7, ?8, NULL, NULL, '' FROM webhook "
    "WHERE id = ?2";
constexpr const char* k_forget_old =
    "DELETE FROM webhook_delivery WHERE webhook_key = (SELECT webhook_key FROM webhook WHERE id = ?1) AND "
    "delivery_key <= (SELECT delivery_key FROM webhook_delivery WHERE webhook_key = (SELECT webhook_key FROM "
    "webhook WHERE id = ?1) ORDER BY delivery_key DESC LIMIT 1 OFFSET ?2)";
constexpr const char* k_delivery_columns =
    "SELECT d.id, w.id, d.event, d.body, d.state, d.created_t_ns, d.attempts, d.due_ran_ns, d.tried_t_ns, "
    "d.status, d.fault FROM webhook_delivery AS d JOIN webhook AS w ON w.webhook_key = d.webhook_key ";
constexpr const char* k_webhook_record =
    "UPDATE webhook_delivery SET state = ?2, attempts = ?3, due_ran_ns = ?4, tried_t_ns = ?5, status = ?6, "
    "fault = ?7 WHERE id = ?1";

/// Codes have no blanks: one text, as they are read by people with sqlite3.
std::string joined(const std::vector<std::string>& events) {
  std::string out;
  for (const auto& one : events) out += (out.empty() ? "" : " ") + one;
  return out;
}
std::vector<std::string> parted(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t from = 0; from < text.size();) {
    const auto end = std::min(text.find(' ', from), text.size());
    out.push_back(text.substr(from, end - from));
    from = end + 1;
  }
  return out;
}

std::vector<Webhook> all_webhooks(Query& query) {
  std::vector<Webhook> found;
  while (query.step()) {
    Webhook w;
    w.id = query.id<WebhookId>();
    w.name = query.text();
    w.url = query.text();
    w.secret = query.text();
    w.events = parted(query.text());
    w.enabled = query.integer() != 0;
    w.created = query.time();
    w.version = query.as<std::uint64_t>();
    w.kind = query.one_of(k_webhook_kind_words);
    w.dialect = query.one_of(k_dialect_words);
    w.token = query.text();
    found.push_back(std::move(w));
  }
  return found;
}

std::vector<WebhookDelivery> all_deliveries(Query& query) {
  std::vector<WebhookDelivery> found;
  while (query.step()) {
    WebhookDelivery d;
    d.id = query.id<DeliveryId>();
    d.webhook = query.id<WebhookId>();
    d.event = query.text();
    d.body = query.document();
    d.state = query.one_of(k_delivery_words);
    d.created = query.time();
    d.attempts = query.as<int>();
    d.due_ran_ns = query.integer();
    d.tried = query.maybe([&] { return query.time(); });
    d.status = query.maybe([&] { return query.as<int>(); });
    d.fault = query.text();
    found.push_back(std::move(d));
  }
  return found;
}

class SqlWebhookStore final : public WebhookStore {
 public:
  explicit SqlWebhookStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Webhook& w) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_webhook_insert);
      query << w.id << w.name << w.url << w.secret << joined(w.events) << w.enabled << w.created << w.version
            << static_cast<std::uint8_t>(w.kind) << static_cast<std::uint8_t>(w.dialect) << w.token;
      query.run();
      return std::nullopt;
    });
  }
  Result<void> update(const Webhook& w, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_webhook_update);
      query << w.id << w.name << w.url << w.secret << joined(w.events) << w.enabled << expected_version + 1
            << expected_version << static_cast<std::uint8_t>(w.dialect) << w.token;
      if (query.returned()) return std::nullopt;
      Query known(c, std::string(k_webhook_columns) + "WHERE id = ?1");
      known << w.id;
      if (known.step()) return make_error(Errc::conflict, "the webhook was changed in the meantime");
      return absent("webhook", w.id);
    });
  }
  Result<Webhook> webhook(const WebhookId& id) override {
    return read_value<Webhook>(gate_, [&](Connection& c) -> Result<Webhook> {
      Query query(c, std::string(k_webhook_columns) + "WHERE id = ?1");
      query << id;
      auto found = all_webhooks(query);
      if (found.empty()) return absent("webhook", id);
      return std::move(found.front());
    });
  }
  Result<std::vector<Webhook>> webhooks() override {
    return read_value<std::vector<Webhook>>(gate_, [&](Connection& c) -> Result<std::vector<Webhook>> {
      Query query(c, std::string(k_webhook_columns) + "ORDER BY webhook_key");
      return all_webhooks(query);
    });
  }
  Result<void> remove(const WebhookId& id) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_webhook_remove);
      query << id;
      if (query.returned()) return std::nullopt;
      return absent("webhook", id);
    });
  }

  Result<void> add(const std::vector<WebhookDelivery>& deliveries) override {
    return write_void(
        gate_,
        [&](Connection& c) -> std::optional<Error> {
          for (const auto& d : deliveries) {
            Query query(c, k_add);
            query << d.id << d.webhook << d.event << d.body << static_cast<std::uint8_t>(d.state) << d.created
                  << d.attempts << d.due_ran_ns;
            query.run();
            Query old(c, k_forget_old);
            old << d.webhook << row_limit(k_kept_deliveries);
            old.run();
          }
          return std::nullopt;
        },
        deliveries.size());
  }
  Result<std::vector<WebhookDelivery>> pending(const WebhookId& webhook, std::size_t limit) override {
    return deliveries_where(
        "WHERE w.id = ?1 AND d.state = 0 AND w.enabled = 1 ORDER BY d.due_ran_ns, d.delivery_key LIMIT ?2",
        [&](Query& query) { query << webhook << row_limit(limit); });
  }
  Result<void> record(const WebhookDelivery& d) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_webhook_record);
      query << d.id << static_cast<std::uint8_t>(d.state) << d.attempts << d.due_ran_ns << d.tried << d.status
            << d.fault;
      query.run();
      return std::nullopt;
    });
  }
  Result<std::vector<WebhookDelivery>> deliveries(const WebhookId& webhook, std::size_t limit,
                                                  const std::optional<DeliveryId>& before) override {
    return deliveries_where(
        before ? "WHERE w.id = ?1 AND d.delivery_key < (SELECT delivery_key FROM webhook_delivery WHERE id = "
                 "?3) ORDER BY d.delivery_key DESC LIMIT ?2"
               : "WHERE w.id = ?1 ORDER BY d.delivery_key DESC LIMIT ?2",
        [&](Query& query) {
          query << webhook << row_limit(limit);
          if (before) query << *before;
        });
  }

 private:
  template <class Bind>
  Result<std::vector<WebhookDelivery>> deliveries_where(const char* where, const Bind& bind) {
    return read_value<std::vector<WebhookDelivery>>(
        gate_, [&](Connection& c) -> Result<std::vector<WebhookDelivery>> {
          Query query(c, std::string(k_delivery_columns) + where);
          bind(query);
          return all_deliveries(query);
        });
  }
  Gate& gate_;
};

}  // namespace

std::unique_ptr<WebhookStore> make_webhook_store(Gate& gate) {
  return std::make_unique<SqlWebhookStore>(gate);
}

}  // namespace anchord::sql
