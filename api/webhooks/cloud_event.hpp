#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/types/live_event.hpp"
#include "core/types/webhook.hpp"

namespace anchord::api {

/// What an omlox hub is sent beside revisions: where the tag is now.
inline constexpr std::string_view k_location_event = "location.updated";
/// Codes of the event log that webhooks may ask for, and what only hubs may.
inline constexpr std::array<std::string_view, 6> k_webhook_events{"revision.published", "anchor.contradicted",
                                                                  "alarm.raised",       "alarm.cleared",
                                                                  "mission.finished",   k_location_event};
/// Whether a receiver of this kind may ask for it.
bool may_ask_for(WebhookKind kind, std::string_view event);
/// What POST /webhooks/{id}/test sends, asked for or not.
inline constexpr std::string_view k_test_event = "webhook.test";

/// CloudEvents 1.0 in JSON, structured mode: type "anchord." and the code, subject the mission where there is
/// one.
std::string cloud_event(const LiveEvent& event);

/// Standard Webhooks 1.0, symmetric: "v1," and the base64 of HMAC-SHA256 over "ID.SECONDS.BODY". The key is
/// what stands as base64 behind "whsec_" of the secret.
std::string webhook_signature(std::string_view secret, std::string_view id, std::int64_t seconds,
                              std::string_view body);
std::string make_webhook_secret();

}  // namespace anchord::api
