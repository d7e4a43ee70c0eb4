#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/document.hpp"
#include "core/types/omlox_dialect.hpp"

namespace anchord {

using WebhookId = Id<struct WebhookTag>;
using DeliveryId = Id<struct DeliveryTag>;

enum class WebhookKind : std::uint8_t {
  cloud_event,  ///< gets each event as a signed CloudEvent
  omlox_hub,    ///< gets zones and locations by the API of an omlox hub
};
inline constexpr auto k_webhook_kind_words = enum_table<WebhookKind>(
    {{"cloud_event", WebhookKind::cloud_event}, {"omlox_hub", WebhookKind::omlox_hub}});

/// An address outside that is notified of events.
struct Webhook {
  WebhookId id{};
  std::string name, url;
  std::string secret;               ///< "whsec_" and base64: what deliveries are signed with; empty of a hub
  std::vector<std::string> events;  ///< codes of the event log, e.g. "revision.published"
  bool enabled{true};
  UtcTime created{};
  std::uint64_t version{1};  ///< for ETag
  WebhookKind kind{WebhookKind::cloud_event};
  OmloxDialect dialect{OmloxDialect::official};  ///< of a hub
  std::string token;                             ///< of a hub: Authorization: Bearer; empty: none
};

enum class DeliveryState : std::uint8_t {
  pending,    ///< waits for its next attempt
  delivered,  ///< answered with 2xx
  failed,     ///< given up
};
inline constexpr auto k_delivery_words = enum_table<DeliveryState>({{"pending", DeliveryState::pending},
                                                                    {"delivered", DeliveryState::delivered},
                                                                    {"failed", DeliveryState::failed}});

/// One event on its way to one webhook.
struct WebhookDelivery {
  DeliveryId id{};  ///< the same in every attempt: receivers know repetitions by it
  WebhookId webhook{};
  std::string event;
  Document body;  ///< a CloudEvent
  DeliveryState state{DeliveryState::pending};
  UtcTime created{};
  int attempts{};
  std::int64_t due_ran_ns{};  ///< next attempt, in running time of the service
  std::optional<UtcTime> tried{};
  std::optional<int> status{};  ///< of the newest answer
  std::string fault;            ///< why the newest attempt failed; empty: it did not
};

}  // namespace anchord
