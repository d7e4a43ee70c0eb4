#pragma once

#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/localize/kit_profile.hpp"

namespace anchord {

/// A kit profile as kept on disk and on the wire (docs/formats.md): information form, one factor per flight.
std::string kit_profile_json(const KitProfile& profile);
/// errors: invalid_argument naming what is wrong (schema, unknown key, not symmetric, not finite)
Result<KitProfile> parse_kit_profile(std::string_view json);

}  // namespace anchord
