#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "core/ports/calibration_store.hpp"
#include "core/ports/revision_store.hpp"
#include "server/storage/sql.hpp"

/// Calibrations, revisions and the positions they publish; CalibrationStore and RevisionStore say what each
/// means.
namespace anchord::sql {

std::optional<Error> insert_calibration(Connection& connection, const Calibration& calibration);
Result<Calibration> find_calibration(Connection& connection, const CalibrationId& id);
Result<std::vector<Calibration>> list_calibrations(Connection& connection, std::int64_t limit,
                                                   const std::optional<CalibrationId>& after);
std::optional<Error> remove_calibration(Connection& connection, const CalibrationId& id);
Result<Revision> publish_revision(Connection& connection, const CalibrationId& id,
                                  const std::vector<NetworkId>& anchors, std::string_view by,
                                  std::string_view note, UtcTime now, const std::vector<Override>& overrides,
                                  std::optional<std::uint64_t> decided_on);
Result<std::string> find_evidence(Connection& connection, const CalibrationId& id);
Result<std::vector<Revision>> list_revisions(Connection& connection, std::int64_t limit,
                                             std::uint64_t before);
Result<std::vector<PublishedPosition>> positions_of_revision(Connection& connection,
                                                             std::optional<std::uint64_t> revision);
Result<std::optional<PublishedPosition>> position_in_revision(Connection& connection, NetworkId network_id,
                                                              std::uint64_t revision);
Result<std::vector<PublishedPosition>> positions_of_anchor(Connection& connection, NetworkId network_id);

/// All estimates of one calibration, in the order in which it has them.
void store_estimates(Connection& connection, std::int64_t calibration_key,
                     const std::vector<Estimate>& estimates);
std::vector<Estimate> read_estimates(Connection& connection, std::int64_t calibration_key);
std::optional<Estimate> read_estimate(Connection& connection, std::int64_t calibration_key, NetworkId anchor);

}  // namespace anchord::sql
