#pragma once

#include <filesystem>

#include "api/bundles/routes.hpp"

namespace anchord::api {

class SpoolFolder;

/// What becomes of a file that came, as an answer: it is a flight or a site, the file says which. Throws the
/// problem where it is refused.
Response import_answer(BundleApi& s, const Request& request, const std::filesystem::path& file,
                       const SpoolFolder& folder);

}  // namespace anchord::api
