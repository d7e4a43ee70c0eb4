#include "api/webhooks/cloud_event.hpp"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/admin/secrets.hpp"
#include "core/base/base64.hpp"
#include "core/base/bytes.hpp"
#include "core/base/check.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

constexpr std::string_view k_prefix = "whsec_";

}  // namespace

bool may_ask_for(WebhookKind kind, std::string_view event) {
  if (kind == WebhookKind::omlox_hub) return event == "revision.published" || event == k_location_event;
  return event != k_location_event;
}

std::string cloud_event(const LiveEvent& event) {
  nlohmann::ordered_json out{{"specversion", "1.0"},
                             {"id", to_string(event.id)},
                             {"source", "/api/v1"},
                             {"type", "anchord." + event.code},
                             {"time", to_rfc3339(event.time)},
                             {"datacontenttype", "application/json"}};
  if (event.mission) out["subject"] = "missions/" + to_string(*event.mission);
  out["data"] = {{"level", to_string(event.level)},
                 {"code", event.code},
                 {"text", event.text},
                 {"mission", event.mission ? nlohmann::ordered_json(to_string(*event.mission)) : nullptr}};
  return to_wire(out);
}

std::string webhook_signature(std::string_view secret, std::string_view id, std::int64_t seconds,
                              std::string_view body) {
  ANCHORD_CHECK(secret.starts_with(k_prefix), "the secret of a webhook must begin with " << k_prefix);
  const auto key = from_base64(secret.substr(k_prefix.size()));
  ANCHORD_CHECK(key && !key->empty(), "the secret of a webhook must be base64");
  const std::string text = std::string(id) + '.' + std::to_string(seconds) + '.' + std::string(body);
  unsigned char mac[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  const auto* made =
      HMAC(EVP_sha256(), key->data(), static_cast<int>(key->size()), bytes_of(text), text.size(), mac, &size);
  ANCHORD_CHECK(made != nullptr, "HMAC-SHA256 is not available");
  return "v1," + base64({reinterpret_cast<const char*>(mac), size});
}

std::string make_webhook_secret() { return std::string(k_prefix) + base64(random_hex_256()); }

}  // namespace anchord::api
