#pragma once

#include <string>

namespace anchord::cli {

class RestClient;

/// A raw recording through the drivers again. Rows go as NDJSON to `folder` (fixes.ndjson, ranges.ndjson), to
/// standard output when it is "-", or with a client into the server that holds their missions. Exit code.
int replay_recording(const std::string& file, const std::string& folder, RestClient* client);

}  // namespace anchord::cli
