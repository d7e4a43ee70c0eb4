#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "api/formats/foreign_flight.hpp"

namespace anchord::api {

using TagArms = std::map<NetworkId, Eigen::Vector3d>;

/// Lever arms that a person gave for single tags. errors: two for one tag
Result<TagArms> arms_of(const ForeignOptions& options, AddressKind addresses);
/// errors  invalid_argument: an arm of a tag that has no range, a tag without one where others have
Result<void> check_arms(const TagArms& arms, const ForeignOptions& options, const std::vector<Range>& ranges);
/// One arm for several tags; an address that is tag and anchor.
void note_tags(const std::string& table, const TagArms& arms, const std::vector<Range>& ranges,
               std::vector<std::string>& notes_out);

}  // namespace anchord::api
