#include "api/bundles/upload_store.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::size_t k_most = 64, k_most_of_token = 4;
constexpr std::uint64_t k_gib = std::uint64_t{1} << 30;
constexpr std::uint64_t k_most_bytes = 16 * k_gib, k_most_bytes_of_token = 4 * k_gib;
constexpr std::uint64_t k_spare_bytes = k_gib / 4;
constexpr std::chrono::hours k_upload_time{48};
constexpr std::size_t k_taken_bytes = std::size_t{1} << 18;

std::string id_of(const std::string& token_id, std::uint64_t bytes, const std::string& sha256_hex) {
  Sha256 sum;
  sum.add(token_id + '\n' + std::to_string(bytes) + '\n' + sha256_hex);
  const auto digest = sum.digest();
  Uuid id;
  std::copy_n(digest.begin(), id.bytes.size(), id.bytes.begin());
  id.bytes[6] = static_cast<std::uint8_t>((id.bytes[6] & 0x0f) | 0x80);  // version 8: of our own making
  id.bytes[8] = static_cast<std::uint8_t>((id.bytes[8] & 0x3f) | 0x80);
  return to_string(id);
}

Error cannot_add(int why) {
  return make_error(why == ENOSPC || why == EDQUOT ? Errc::storage_full : Errc::storage_unavailable,
                    std::string("cannot write a part of a bundle: ") + std::strerror(why));
}

/// Oldest first.
void sort_by_age(std::vector<Upload>& uploads) { std::ranges::sort(uploads, {}, &Upload::expires); }

}  // namespace

fs::path UploadStore::note_of(std::string_view id) const { return folder_ / (std::string(id) + ".json"); }
fs::path UploadStore::part_of(std::string_view id) const { return folder_ / (std::string(id) + ".part"); }

std::optional<Upload> UploadStore::read(const std::string& id) const {
  std::ifstream in(note_of(id));
  const auto note = Json::parse(std::string(std::istreambuf_iterator<char>(in), {}), nullptr, false);
  std::error_code error;
  Upload out;
  out.id = id;
  out.file = part_of(id);
  if (!note.is_object()) return std::nullopt;
  out.token_id = note.value("token", "");
  out.sha256_hex = note.value("sha256", "");
  out.bytes = note.value("bytes", std::uint64_t{});
  out.offset = fs::file_size(out.file, error);
  if (error) return std::nullopt;
  const auto age = fs::file_time_type::clock::now() - fs::last_write_time(out.file, error);
  if (error || age > k_upload_time) {
    remove(out);
    return std::nullopt;
  }
  const auto left = std::chrono::duration_cast<std::chrono::seconds>(k_upload_time - age);
  out.expires = {SystemClock{}.now().ns + std::chrono::nanoseconds(left).count()};
  return out;
}

Result<UploadStore::Begun> UploadStore::begin(const std::string& token_id, std::uint64_t bytes,
                                              const std::string& sha256_hex) const {
  std::error_code error;
  fs::create_directories(folder_, error);
  fs::permissions(folder_, fs::perms::owner_all, error);
  const auto id = id_of(token_id, bytes, sha256_hex);
  if (auto here = read(id)) return Begun{*std::move(here), false};
  std::vector<Upload> own, others;
  for (const auto& entry : fs::directory_iterator(folder_, error)) {
    if (entry.path().extension() != ".json") continue;
    if (auto one = read(entry.path().stem().string()))
      (one->token_id == token_id ? own : others).push_back(*std::move(one));
  }
  const auto sum = [](const std::vector<Upload>& uploads) {
    std::uint64_t out = 0;
    for (const auto& one : uploads) out += one.bytes;
    return out;
  };
  sort_by_age(own);
  while (!own.empty() && (own.size() >= k_most_of_token || sum(own) + bytes > k_most_bytes_of_token)) {
    remove(own.front());
    own.erase(own.begin());
  }
  if (own.size() + others.size() >= k_most || sum(own) + sum(others) + bytes > k_most_bytes)
    return make_error(Errc::queue_full, "too many bundles are on their way to this server");
  std::uint64_t to_come = bytes + k_spare_bytes;
  for (const auto* list : {&own, &others})
    for (const auto& one : *list) to_come += one.bytes - std::min(one.bytes, one.offset);
  const auto space = fs::space(folder_, error);
  if (error) return cannot_add(error.value());
  if (space.available < to_come)
    return make_error(Errc::storage_full,
                      "not enough space for a bundle of " + std::to_string(bytes) + " bytes");
  errno = 0;
  std::ofstream part(part_of(id), std::ios::binary);
  part.close();
  std::ofstream note(note_of(id), std::ios::binary);
  note << to_wire(Json{{"token", token_id}, {"sha256", sha256_hex}, {"bytes", bytes}}) << '\n';
  note.close();
  auto made = read(id);
  if (!part || !note || !made) return cannot_add(errno);
  return Begun{*std::move(made), true};
}

Result<Upload> UploadStore::find(const std::string& token_id, std::string_view id) const {
  auto found = parse_uuid(id) ? read(std::string(id)) : std::nullopt;
  if (!found || found->token_id != token_id)
    return make_error(
        Errc::not_found,
        "no upload of this token has this id: it expired, or gave way to a newer one; begin it again");
  return *std::move(found);
}

Result<std::uint64_t> UploadStore::add(const Upload& upload, const Request& request) const {
  errno = 0;
  std::fstream file(upload.file, std::ios::in | std::ios::out | std::ios::binary);
  if (!file || !file.seekp(static_cast<std::streamoff>(upload.offset))) return cannot_add(errno);
  std::uint64_t at = upload.offset;
  std::vector<char> piece(k_taken_bytes);
  for (std::size_t n; (n = request.body_stream->read(piece)) > 0; at += n) {
    if (n > upload.bytes - at)
      return make_error(Errc::invalid_argument, "the body has more than the " +
                                                    std::to_string(upload.bytes - upload.offset) +
                                                    " bytes that are missing");
    errno = 0;
    if (!file.write(piece.data(), static_cast<std::streamsize>(n)) || !file.flush()) return cannot_add(errno);
  }
  return at;
}

void UploadStore::remove(const Upload& upload) const {
  std::error_code gone;
  fs::remove(note_of(upload.id), gone);
  fs::remove(upload.file, gone);
}

}  // namespace anchord::api
