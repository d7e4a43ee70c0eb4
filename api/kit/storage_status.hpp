#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace anchord::api {

/// State of storage as the world may know it.
struct StorageStatus {
  bool writable{true};
  std::string reason;   ///< why not, in words
  bool stalled{false};  ///< a write has been under way for seconds; reason says how long
  std::uint64_t db_bytes{0}, disk_free_bytes{0}, queue_depth{0};
  std::string synchronous{"full"};
  std::optional<bool> stood_by{};  ///< another server waits to take over; nothing where none ever can
};

}  // namespace anchord::api
