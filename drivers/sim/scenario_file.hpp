#pragma once

#include <filesystem>
#include <string_view>

#include "core/base/result.hpp"
#include "drivers/sim/scenario.hpp"

namespace anchord::sim {

/// A scenario as docs/formats.md describes it ("Scenario"). What is left out is as in the demonstration.
/// errors: bad_frame (no JSON), invalid_argument (names the path of the field; unknown fields are refused,
/// since a typo is how a setting gets lost), those of check().
Result<Scenario> parse_scenario(std::string_view json);
/// The same from a file; "demonstration" is the built-in one. not_found.
Result<Scenario> read_scenario(const std::filesystem::path& file);

}  // namespace anchord::sim
