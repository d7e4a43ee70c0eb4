#pragma once

#include <memory>
#include <string>

#include "core/ports/work_store.hpp"
#include "server/storage/sql.hpp"

namespace anchord {
namespace sql {

/// Of PostgreSQL alone: its clock, and rows that are passed over while another has them. The gate outlives
/// it.
std::unique_ptr<WorkStore> make_work_store(Gate& gate);

}  // namespace sql

/// The work of a database, for a process that is not its server: no data folder, and nothing is migrated. The
/// role needs the rights of docs/workers.md. Errors: invalid_argument (address), unsupported (the database
/// has another version than this program), storage_unavailable.
Result<std::unique_ptr<WorkStore>> open_work(const std::string& address);

}  // namespace anchord
