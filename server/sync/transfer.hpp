#pragma once

#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "server/http/http_client.hpp"
#include "server/sync/spool.hpp"

namespace anchord::sync {

class Peer;
struct Run;

struct Fetched {
  server::ClientResponse answer;
  Spool file;  ///< the bundle, where the answer is 200
};
/// A bundle of a server. What comes from the centre is kept beside the state file until it is whole: after a
/// cut, and in a later run, the rest alone is asked for, where the centre still has the same bytes. `known`
/// is a digest for If-None-Match. errors: of the link; invalid_argument (not the bytes that the ETag names)
Result<Fetched> fetch_bundle(Run& run, Peer& peer, const std::string& target, const std::string& known = {});

/// A bundle to the target: in parts, which it keeps, where it is more than some and the target takes parts;
/// else whole. The answer is that of POST /bundles. errors: of the link
Result<server::ClientResponse> send_bundle(Run& run, const Spool& file, std::string_view type);

/// Parts of bundles that no run came back for.
void remove_old_parts(const Run& run);

}  // namespace anchord::sync
