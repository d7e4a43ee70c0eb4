#pragma once

#include <filesystem>

#include "core/base/result.hpp"

namespace anchord::server {

/// Prints a page of our own with the Chromium of this machine, where there is one: no network, a profile in a
/// folder beside the PDF, no longer than 60 s. errors: unsupported (none), internal (it did not print)
Result<void> print_with_chromium(const std::filesystem::path& html, const std::filesystem::path& pdf);

}  // namespace anchord::server
