#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/anchor.hpp"

namespace anchord {

/// Solved calibrations, newest first.
class CalibrationStore {
 public:
  virtual ~CalibrationStore() = default;
  virtual Result<void> insert(const Calibration& calibration) = 0;
  virtual Result<Calibration> calibration(const CalibrationId& id) = 0;
  virtual Result<std::vector<Calibration>> calibrations(std::size_t limit,
                                                        const std::optional<CalibrationId>& after) = 0;
  /// What insert was given as evidence_json; empty when there was none.
  virtual Result<std::string> evidence(const CalibrationId& id) = 0;
  virtual Result<void> remove(const CalibrationId& id) = 0;  ///< conflict when a revision uses it
};

}  // namespace anchord
