#pragma once

#include <set>
#include <string>

namespace anchord::api {

/// Names of the fields that an item of the list at this path of the contract ("/api/v1/missions/{id}/events")
/// may have; empty where the contract knows no such list. Thread-safe.
std::set<std::string> item_fields(const std::string& path);

}  // namespace anchord::api
