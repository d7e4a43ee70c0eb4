#pragma once

#include "core/base/result.hpp"
#include "server/cli/rest_client.hpp"
#include "server/cli/site_learning.hpp"

namespace anchord::cli {

/// A finished flight round the demonstration building, its calibration, and a revision of the anchors that
/// passed the gates. What is there by name, and what came of it, is taken as it is. Nothing is published
/// beside other revisions unless `over_others`.
/// errors  those of the client; conflict: the calibration failed, or no anchor passed its gates
Result<void> add_demonstration_flight(RestClient& client, bool over_others, const Told& told);

}  // namespace anchord::cli
