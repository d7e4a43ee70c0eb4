#pragma once

#include <cstdint>
#include <vector>

#include "api/anchors/anchor_json.hpp"
#include "api/kit/message.hpp"

namespace anchord::api {

struct AnchorApi;

/// The anchors a request asks for by view, revision, mission, site and bbox, in order of network id; `number`
/// is the revision that was read, 0 where none was.
std::vector<AnchorFeature> selected_anchors(AnchorApi& services, const Request& request,
                                            std::uint64_t& number);

}  // namespace anchord::api
