#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/base/result.hpp"
#include "core/types/exclusion.hpp"

namespace anchord::api {

/// As the wire has it: rows that are named one by one by their keys, a span by its ends.
nlohmann::ordered_json exclusion_json(const Exclusion& exclusion);
/// What it takes out, without who, when and why: the bytes of provenance digests.
std::string exclusion_canonical(const Exclusion& exclusion);

/// Body of POST /missions/{id}/exclusions.
struct ExclusionRequest {
  RowSelection selection{};
  std::vector<std::int64_t> ids;  ///< rows of the store
  std::string reason;
};
/// What is wrong is appended to `errors`.
ExclusionRequest read_exclusion_request(const nlohmann::json& body, std::vector<FieldError>& errors);
/// The body that makes it again at another server, by keys.
std::string exclusion_request_json(const Exclusion& exclusion);

}  // namespace anchord::api

namespace anchord {

/// exclusions.json of a flight folder (docs/formats.md), those taken back too.
std::string exclusions_file_json(const std::vector<Exclusion>& exclusions);
/// errors: invalid_argument naming the place in the file
Result<std::vector<Exclusion>> parse_exclusions_file(std::string_view text);

}  // namespace anchord
