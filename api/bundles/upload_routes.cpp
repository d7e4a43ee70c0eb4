// A bundle that comes in parts, over a link that is cut: the rules of offsets are those of tus 1.0.
#include <nlohmann/json.hpp>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/import_answer.hpp"
#include "api/bundles/routes.hpp"
#include "api/bundles/spool.hpp"
#include "api/bundles/upload_store.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"

namespace anchord::api {
namespace {

constexpr std::string_view k_part_type = "application/offset+octet-stream";
constexpr std::size_t k_sha256_digits = 64;

UploadStore store_of(const BundleApi& s) { return UploadStore(s.spool.string() + "-uploads"); }

Upload upload_of(const BundleApi& s, const Request& request) {
  return value_or_problem(store_of(s).find(request.principal.token_id, to_string(path_uuid(request))));
}

Response with_offset(Response response, const Upload& upload) {
  response.header("Upload-Offset", std::to_string(upload.offset));
  response.header("Upload-Length", std::to_string(upload.bytes));
  return response;
}
Response shown(int status, const Upload& upload) {
  return with_offset(json_response(status, {{"id", upload.id},
                                            {"bytes", upload.bytes},
                                            {"offset", upload.offset},
                                            {"sha256", upload.sha256_hex},
                                            {"expires_at", to_rfc3339(upload.expires)}}),
                     upload);
}

Response begin_upload(BundleApi& s, const Request& request) {
  check_query(request, {});
  const auto body = json_body(request);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  const auto bytes = fields.integer("bytes", 1, static_cast<std::int64_t>(k_bundle_bytes), true);
  const auto sha256 = fields.text("sha256", k_sha256_digits, true);
  if (sha256 && (sha256->size() != k_sha256_digits ||
                 sha256->find_first_not_of("0123456789abcdef") != std::string::npos))
    fields.error("sha256", "wrong_format", "must be 64 hex digits in lower case, of the whole bundle");
  fields.finish();
  refuse_if_any(errors);
  const auto begun = value_or_problem(
      store_of(s).begin(request.principal.token_id, static_cast<std::uint64_t>(*bytes), *sha256));
  auto response = shown(begun.is_new ? 201 : 200, begun.upload);
  response.header("Location", "/api/v1/bundles/uploads/" + begun.upload.id);
  return response;
}

Response show_upload(BundleApi& s, const Request& request) {
  check_query(request, {});
  return shown(200, upload_of(s, request));
}

Response add_part(BundleApi& s, const Request& request) {
  check_query(request, {});
  if (media_type(request) != k_part_type)
    throw_problem(415, "media-type", "send a part with Content-Type: " + std::string(k_part_type));
  auto upload = upload_of(s, request);
  const auto offset = request.header("upload-offset");
  if (offset != std::to_string(upload.offset)) {
    throw ProblemException{with_offset(
        problem(409, "conflict",
                "Upload-Offset must be " + std::to_string(upload.offset) + ", the bytes that are here"),
        upload)};
  }
  const auto added = store_of(s).add(upload, request);
  if (!added && added.error().code == Errc::invalid_argument)
    throw_problem(413, "too-large", added.error().message);
  upload.offset = value_or_problem(added);
  Response response;
  response.status = 204;
  return with_offset(std::move(response), upload);
}

Response remove_upload(BundleApi& s, const Request& request) {
  check_query(request, {});
  store_of(s).remove(upload_of(s, request));
  Response response;
  response.status = 204;
  return response;
}

/// Stays after it: the answer may be lost, and is then asked for again.
Response import_upload(BundleApi& s, const Request& request) {
  check_query(request, {});
  const auto upload = upload_of(s, request);
  if (upload.offset != upload.bytes)
    throw ProblemException{with_offset(
        problem(409, "conflict",
                std::to_string(upload.bytes - upload.offset) + " bytes of the bundle are missing"),
        upload)};
  const auto whole = value_or_problem(entry_of("the upload", upload.file));
  if (whole.sha256_hex != upload.sha256_hex) {
    store_of(s).remove(upload);
    throw_problem(422, "validation",
                  "what arrived does not have the SHA-256 that was announced. Nothing was imported: send the "
                  "bundle again");
  }
  const auto folder = value_or_problem(SpoolFolder::make(s.spool));
  return import_answer(s, request, upload.file, *folder);
}

}  // namespace

void add_upload_routes(Router& router, BundleApi& s) {
  const auto engineers = Access::any_of({Role::engineer});
  router.add({Method::post, "/api/v1/bundles/uploads", engineers,
              [&s](const Request& request) { return begin_upload(s, request); }, k_command_bytes});
  router.add({Method::get, "/api/v1/bundles/uploads/{id}", engineers,
              [&s](const Request& request) { return show_upload(s, request); }});
  router.add({Method::patch, "/api/v1/bundles/uploads/{id}", engineers,
              [&s](const Request& request) { return add_part(s, request); }, k_bundle_bytes, true});
  router.add({Method::del, "/api/v1/bundles/uploads/{id}", engineers,
              [&s](const Request& request) { return remove_upload(s, request); }});
  router.add({Method::post, "/api/v1/bundles/uploads/{id}/import", engineers,
              [&s](const Request& request) { return import_upload(s, request); }, k_command_bytes});
}

}  // namespace anchord::api
