#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

namespace anchord::api {

/// What is not known is null on the wire, never left out.
template <class T, class Json = nlohmann::ordered_json>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

template <class Json = nlohmann::ordered_json>
Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

}  // namespace anchord::api
