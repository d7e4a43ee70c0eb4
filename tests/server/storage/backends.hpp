#pragma once

#include "tests/server/storage/store_contract.hpp"

namespace anchord {

inline std::unique_ptr<Database> open_sqlite(const std::filesystem::path& dir) {
  StorageOptions options;
  options.data_dir = dir;
  options.reserve_bytes = 0;
  auto db = open_database(options);
  EXPECT_TRUE(db) << db.error().message;
  return db ? std::move(db).value() : nullptr;
}

inline auto backends() { return testing::Values(Backend{"sqlite", open_sqlite}); }
inline std::string backend_name(const testing::TestParamInfo<Backend>& info) { return info.param.name; }

}  // namespace anchord
