#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"

namespace anchord::api {

class SpoolFolder;

/// A bundle that was made for a request.
struct MadeBundle {
  std::filesystem::path file;
  std::string digest;  ///< 64 hex digits, of what it has: the same for the same
  std::string_view type;
  std::string name;  ///< for who saves it
};

/// Bundles that were sent stay for a day, so that a link that is cut costs the rest alone: each for the token
/// that asked, with its roles and sites, under an ETag of its bytes. At most 4 of one token, 16 and 8 GiB in
/// all, and none where less than 1 GiB of the disk would be free; the oldest go. They survive a restart. Any
/// thread; `spool` is the folder of requests, they have one beside it.

/// The part that a request names by Range, of what was kept for it: with If-Range of just that. Nothing: it
/// names none, or that is not here (any more).
std::optional<Response> kept_part(const std::filesystem::path& spool, const Request& request,
                                  std::string_view type, const std::string& name);

/// The answer with this bundle: 200, 206 and 416 by Range, 304 by If-None-Match, which may also name the
/// digest alone. Kept from here on; one that is kept with the same content is sent in its place.
Response bundle_answer(const std::filesystem::path& spool, const Request& request,
                       std::shared_ptr<SpoolFolder> folder, const MadeBundle& made);

}  // namespace anchord::api
