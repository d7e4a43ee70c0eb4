#pragma once

#include "core/base/result.hpp"

namespace anchord {

/// Worth another try later: the store, not what it was given, is in trouble.
constexpr bool may_pass(Errc code) {
  return code == Errc::storage_full || code == Errc::storage_unavailable || code == Errc::queue_full;
}

}  // namespace anchord
