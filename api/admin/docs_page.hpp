#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// An OpenAPI document as one page of plain HTML: no scripts, no styles, nothing from elsewhere, so that it
/// reads in a field without internet and under our content security policy. Every operation with its
/// parameters, body and answers; every schema with its fields.
std::string docs_page(std::string_view openapi_json);

}  // namespace anchord::api
