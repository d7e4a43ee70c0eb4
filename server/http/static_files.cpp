#include "server/http/static_files.hpp"

#include <algorithm>
#include <span>

#include "server/http/response_writer.hpp"
#include "server/http/text.hpp"
#ifdef ANCHORD_HAS_WEB
#include "web/assets.hpp"
#endif

namespace anchord::server {

#ifdef ANCHORD_HAS_WEB
namespace {

const web::WebAsset* find_asset(std::string_view path) {
  const auto assets = web::web_assets();
  const auto at = std::ranges::find(assets, path, &web::WebAsset::path);
  return at == assets.end() ? nullptr : &*at;
}

/// A view of the page: no dot in its last segment (that would be a file), and nothing that a client of the
/// other faces may have mistyped; such a client wants its 404 and not a page.
bool is_view(std::string_view path) {
  for (const std::string_view face :
       {"/api", "/ogc", "/omlox", "/problems", "/metrics", "/healthz", "/readyz"}) {
    if (iequals(path.substr(0, face.size()), face)) return false;
  }
  if (path.find("//") != std::string_view::npos) return false;
  const auto slash = path.rfind('/');
  return path.find('.', slash == std::string_view::npos ? 0 : slash) == std::string_view::npos;
}

std::string_view text(std::span<const unsigned char> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::optional<api::Response> static_file(const api::Request& request) {
  const web::WebAsset* asset =
      find_asset(request.path == "/" ? "/index.html" : std::string_view(request.path));
  if (asset == nullptr && is_view(request.path)) asset = find_asset("/index.html");
  if (asset == nullptr) return std::nullopt;
  api::Response response;
  response.header("Content-Type", std::string(asset->content_type));
  response.header("Cache-Control", asset->immutable ? "public, max-age=31536000, immutable" : "no-cache");
  response.header("ETag", std::string(asset->etag));
  response.header("Vary", "Accept-Encoding");
  if (request.header("if-none-match").find(asset->etag) != std::string_view::npos) {
    response.status = 304;
    return response;
  }
  const std::string_view accepted = request.header("accept-encoding");
  if (!asset->br.empty() && accepts_coding(accepted, "br")) {
    response.header("Content-Encoding", "br");
    response.body = text(asset->br);
  } else if (!asset->gzip.empty() && accepts_coding(accepted, "gzip")) {
    response.header("Content-Encoding", "gzip");
    response.body = text(asset->gzip);
  } else {
    response.body = text(asset->identity);
  }
  return response;
}

#else

std::optional<api::Response> static_file(const api::Request& request) {
  if (request.path != "/") return std::nullopt;
  api::Response response;
  response.header("Content-Type", "text/plain; charset=utf-8");
  response.body = "anchord is running; this build has no dashboard. The API is at /api/v1.\n";
  return response;
}

#endif

}  // namespace anchord::server
