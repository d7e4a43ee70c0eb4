#pragma once

#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/kit/reader.hpp"
#include "core/types/site_quota.hpp"

namespace anchord::api {

/// {"missions": 200, "measurements": null, ...}: a limit of each kind. All of them are named: one that was
/// forgotten would be none. `words` gets what the audit log says of them.
template <std::size_t n>
QuotaLimits<n> quota_limits(Fields& fields, std::string& words) {
  QuotaLimits<n> limits;
  for (std::size_t i = 0; i < n; ++i) {
    const std::string word(k_quota_kind_words.word(static_cast<QuotaKind>(i)));
    fields.must_be_named(word);
    limits[i] = fields.integer(word, 0, std::numeric_limits<std::int64_t>::max());
    words += ' ' + word + ' ' + (limits[i] ? std::to_string(*limits[i]) : "none");
  }
  return limits;
}

/// {"limits": {...}, "used": {...}, "reached": [...]}, by the words of the kinds.
template <class Json = nlohmann::ordered_json, std::size_t n>
Json quota_json(const Quota<n>& quota) {
  Json limits = Json::object(), used = Json::object(), reached = Json::array();
  for (std::size_t i = 0; i < n; ++i) {
    const auto kind = static_cast<QuotaKind>(i);
    const std::string word(k_quota_kind_words.word(kind));
    limits[word] = quota.limits[i] ? Json(*quota.limits[i]) : Json(nullptr);
    used[word] = quota.used[i];
    if (quota.reached(kind)) reached.push_back(word);
  }
  return {{"limits", std::move(limits)}, {"used", std::move(used)}, {"reached", std::move(reached)}};
}

}  // namespace anchord::api
