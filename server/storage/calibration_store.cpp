#include "server/storage/calibration_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

class SqlCalibrationStore final : public CalibrationStore {
 public:
  explicit SqlCalibrationStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Calibration& calibration) override {
    return write_void(gate_, [&](Connection& c) { return insert_calibration(c, calibration); });
  }
  Result<Calibration> calibration(const CalibrationId& id) override {
    return read_value<Calibration>(gate_, [&](Connection& c) { return find_calibration(c, id); });
  }
  Result<std::vector<Calibration>> calibrations(std::size_t limit,
                                                const std::optional<CalibrationId>& after) override {
    return read_value<std::vector<Calibration>>(
        gate_, [&](Connection& c) { return list_calibrations(c, row_limit(limit), after); });
  }
  Result<std::string> evidence(const CalibrationId& id) override {
    return read_value<std::string>(gate_, [&](Connection& c) { return find_evidence(c, id); });
  }
  Result<void> remove(const CalibrationId& id) override {
    return write_void(gate_, [&](Connection& c) { return remove_calibration(c, id); });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<CalibrationStore> make_calibration_store(Gate& gate) {
  return std::make_unique<SqlCalibrationStore>(gate);
}

}  // namespace anchord::sql
