#pragma once

#include <memory>

#include "server/storage/data_folder.hpp"
#include "server/storage/sqlite_connection.hpp"

namespace anchord::sql {

/// The file of a folder, checked where asked, migrated, made when there never was one. Errors: those of
/// open_database().
Result<std::unique_ptr<SqliteConnection>> open_sqlite_file(const StorageOptions& options, DataFolder& folder,
                                                           bool check);

}  // namespace anchord::sql
