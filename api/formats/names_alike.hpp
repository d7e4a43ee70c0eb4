#pragma once

#include <span>
#include <string>
#include <vector>

namespace anchord::api {

/// A warning for each pair of names that differ in capitals and white space alone: "Room 1" and "room  1" are
/// two places, which nobody wants. `what`: environments, settings.
std::vector<std::string> names_alike(const std::string& what, std::span<const std::string> names);

}  // namespace anchord::api
