#pragma once

#include "core/ports/bundle_store.hpp"
#include "server/storage/cir_file.hpp"
#include "server/storage/sql.hpp"

namespace anchord::sql {

/// All rows of a flight, table by table, with what else they name, so that it stands whole on another
/// server. errors: those of the sink and of the files of impulse responses
Result<void> write_flight(Connection& connection, const MissionId& id, std::int64_t mission,
                          const CirFolder& files, BundleSink& sink);

}  // namespace anchord::sql
