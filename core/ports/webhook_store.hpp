#pragma once

#include <optional>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/webhook.hpp"

namespace anchord {

/// Webhooks with their outbox, which is their log too: the newest k_kept_deliveries of each stay. Callable
/// from any thread; errors as in measurement_store.hpp.
class WebhookStore {
 public:
  static constexpr std::size_t k_kept_deliveries = 500;

  virtual ~WebhookStore() = default;
  virtual Result<void> insert(const Webhook& webhook) = 0;
  /// conflict when it moved on; the stored version becomes expected_version + 1.
  virtual Result<void> update(const Webhook& webhook, std::uint64_t expected_version) = 0;
  virtual Result<Webhook> webhook(const WebhookId& id) = 0;
  virtual Result<std::vector<Webhook>> webhooks() = 0;  ///< in order of creation
  /// With its deliveries.
  virtual Result<void> remove(const WebhookId& id) = 0;

  /// In one transaction. Of a webhook that is gone nothing is kept.
  virtual Result<void> add(const std::vector<WebhookDelivery>& deliveries) = 0;
  /// Pending ones of a webhook, the first due first, whether due yet or not; none while it is disabled.
  virtual Result<std::vector<WebhookDelivery>> pending(const WebhookId& webhook, std::size_t limit) = 0;
  /// What an attempt changed; nothing where the webhook went meanwhile.
  virtual Result<void> record(const WebhookDelivery& delivery) = 0;
  /// Newest first.
  virtual Result<std::vector<WebhookDelivery>> deliveries(const WebhookId& webhook, std::size_t limit,
                                                          const std::optional<DeliveryId>& before) = 0;
};

}  // namespace anchord
