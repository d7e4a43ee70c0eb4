#pragma once

#include <string_view>

namespace anchord::api {

/// The contract documents, JSON made from api/openapi.yaml and api/asyncapi.yaml at build time.
std::string_view openapi_json();
std::string_view asyncapi_json();

}  // namespace anchord::api
