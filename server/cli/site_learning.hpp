#pragma once

#include <functional>
#include <string>

#include "core/base/result.hpp"
#include "server/cli/rest_client.hpp"

namespace anchord::cli {

/// Told of each step, one line of words: what was found or added.
using Told = std::function<void(const std::string&)>;

/// Campaign, data set, training run and promotion of the demonstration. What is there by its name is taken as
/// it is. The gate decides on the promotion; nothing is promoted over another model unless `over_others`.
/// errors  those of the client; conflict: the run failed, or the gate refused
Result<void> add_demonstration_model(RestClient& client, bool over_others, const Told& told);

}  // namespace anchord::cli
