#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <vector>

#include "server/gateway/outbox.hpp"
#include "server/storage/sqlite_connection.hpp"

/// The tables of an outbox: each question and each change to them is a function here.
namespace anchord::gateway {

using Ids = std::set<std::int64_t>;

/// A new file gets its tables; any other must be an outbox, whole and not newer.
Result<void> prepare(sql::SqliteConnection& c, const std::filesystem::path& file);
OutboxState counted(sql::Connection& c, std::uint64_t max_bytes);

/// What came after this one, newest first. `gone`, here and below: left out, as if they were deleted.
Newest newest_on_disk(sql::Connection& c, std::int64_t after, const Ids& gone, std::uint64_t max_bytes);
/// Up to `until`, of the mission whose batch has waited longest and that is not in `waiting`.
std::vector<Batch> oldest_on_disk(sql::Connection& c, std::int64_t until, const std::set<MissionId>& waiting,
                                  const Ids& gone, std::uint64_t max_bytes);
std::optional<UtcTime> oldest_time_on_disk(sql::Connection& c, const Ids& gone);

struct Size {
  std::uint64_t rows{}, bytes{};
};
Size size_of(sql::Connection& c, const std::vector<std::int64_t>& ids);
void insert(sql::Connection& c, const Batch& batch);
/// returns  what it took; nothing where it was not there
Size remove(sql::Connection& c, std::int64_t id);
void add_totals(sql::Connection& c, const Totals& more);

}  // namespace anchord::gateway
