#pragma once

#include "core/base/ids.hpp"

namespace anchord {

using OrganizationId = Id<struct OrganizationTag>;

}  // namespace anchord
