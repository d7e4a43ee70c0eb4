#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/ports/devices.hpp"
#include "server/gateway/outbox.hpp"

namespace anchord::gateway {

/// The rows as batches of the outbox, one for each mission and way of writing, fixes first. CSV has a third
/// of the bytes of JSON; a range with an impulse response or a label is JSON.
std::vector<Batch> batches_of(const DeviceBatch& rows);

/// What stands before the lines in a request; empty: nothing.
std::string_view header_of(Lines lines);
std::string_view content_type_of(Lines lines);
/// "/api/v1/ranges?mission=..."
std::string target_of(Lines lines, const MissionId& mission);

}  // namespace anchord::gateway
