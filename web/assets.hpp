#pragma once

#include <span>
#include <string_view>

namespace anchord::web {

/// One file of the built dashboard, in the encodings a browser may ask for. Views into the binary's read-only
/// data: valid for ever.
struct WebAsset {
  std::string_view
      path;  ///< as requested, e.g. "/index.html" (the page itself, also for "/") or "/assets/map-1a2b.js"
  std::string_view content_type;  ///< with charset where it is text
  std::string_view etag;          ///< strong, quotes included; of the identity bytes
  std::span<const unsigned char> identity;
  std::span<const unsigned char> gzip;  ///< empty when it would not be smaller
  std::span<const unsigned char> br;    ///< empty when it would not be smaller
  bool immutable;  ///< the name carries a hash of the content, so it may be cached for a year
};

/// All files, sorted by path. Callable from any thread.
std::span<const WebAsset> web_assets();

}  // namespace anchord::web
