#pragma once

#include <filesystem>
#include <functional>

#include "core/base/result.hpp"

namespace anchord {

/// Prints a page that is a file into another file, as PDF. Blocks for some seconds.
/// errors  unsupported (this machine has no program for it), internal (it did not print)
using PrintPdf =
    std::function<Result<void>(const std::filesystem::path& html, const std::filesystem::path& pdf)>;

}  // namespace anchord
