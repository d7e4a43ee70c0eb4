#pragma once

#include <filesystem>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/ports/feature_file.hpp"

namespace anchord {
class MeasurementStore;
}

namespace anchord::api {

/// All ranges of a flight as features: each where the receiver of the aircraft was, between the positions
/// before and after it where those are at most 2 s apart, else without a place. Memory is one page, however
/// many there are. errors: of the store and the file; not_found where the mission goes meanwhile
Result<void> write_ranges(MeasurementStore& store, const MissionId& mission, const MakeFeatureFile& make,
                          const std::filesystem::path& file, UtcTime now);

}  // namespace anchord::api
