#pragma once

#include <string>

#include "core/types/bundle.hpp"

namespace anchord::api {

/// What is wrong with a row of a bundle that a database would take and no reader of this server could read
/// again: documents that are none, places that are not on the globe, characters 0. Column and reason; empty:
/// nothing.
std::string fault_of(const BundleTable& table, const BundleRow& row);

}  // namespace anchord::api
