#pragma once

#include <cstddef>

#include "api/learning/model_signer.hpp"

namespace anchord::api {

/// Signs what has no signature yet though this server stands for it: what a run made here, and what was
/// promoted before promotions judged uploads. Once, when the server's key is new. Returns how many it signed.
std::size_t sign_kept_models(ModelStore& store, const ModelSigner& signer);

}  // namespace anchord::api
