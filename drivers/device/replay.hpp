#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "core/base/result.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord::device {

/// Where the rows of a recording go, in the order in which they were made. Rows without a mission are told
/// too.
struct ReplayRows {
  std::function<Result<void>(const Fix&)> fix;
  std::function<Result<void>(const Range&)> range;
};

struct ReplaySummary {
  std::uint64_t events{}, fixes{}, ranges{};
  std::uint64_t unreadable_bytes{};              ///< behind the last good record: a torn tail
  std::map<std::string, std::uint64_t> dropped;  ///< by the drivers, by reason
};

/// Runs a recording (this part and those after it) through the drivers, as fast as they are. The rows are
/// those that were derived when it was recorded, bit for bit. errors: bad_frame (no recording), not_found,
/// those of the functions.
Result<ReplaySummary> replay(const std::filesystem::path& file, const ReplayRows& rows);

/// Whether a file begins as a recording does.
bool is_recording(const std::filesystem::path& file);

}  // namespace anchord::device
