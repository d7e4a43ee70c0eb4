#pragma once

#include <string_view>

#include "core/base/ids.hpp"

namespace anchord::api {

/// RFC 9562 version 5: the same id for the same thing, whoever asks and whenever. What a hub keeps under it
/// is found again after a restart, and nothing has to be stored for that.
Uuid omlox_uuid(std::string_view kind, std::string_view name);

}  // namespace anchord::api
