#include "api/bundles/kept_bundles.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/spool.hpp"
#include "api/kit/content_tag.hpp"
#include "api/kit/problem.hpp"
#include "core/base/sha256.hpp"

namespace anchord::api {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t k_kept = 16, k_kept_of_token = 4;
constexpr std::uint64_t k_kept_bytes = std::uint64_t{8} << 30, k_free_bytes = std::uint64_t{1} << 30;
constexpr std::chrono::hours k_kept_time{24};
constexpr std::size_t k_given_bytes = std::size_t{1} << 18;

/// Of a file's name: token-request-digest-bytes, all in hex.
constexpr std::size_t k_token_digits = 16, k_request_digits = 32, k_digest_digits = 64;
constexpr std::size_t k_name_bytes = k_token_digits + k_request_digits + 2 * k_digest_digits + 3;
constexpr std::size_t k_digest_at = k_token_digits + k_request_digits + 2;

struct Kept {
  fs::path path;
  std::string name;
  std::uint64_t bytes{};
  fs::file_time_type used;
  std::string etag() const {
    return "\"sha256:" + name.substr(k_digest_at, k_digest_digits) + '.' +
           name.substr(k_digest_at + k_digest_digits + 1) + '"';
  }
};

fs::path folder_of(const fs::path& spool) { return spool.string() + "-kept"; }

std::string hex_of(const std::string& text, std::size_t digits) {
  Sha256 sum;
  sum.add(text);
  return sum.hex().substr(0, digits);
}

/// What one request may be answered with is another's only where token, rights and address are the same.
std::string key_of(const Request& request) {
  const auto& who = request.principal;
  std::string text = request.path + '\n' + request.query_value("flights").value_or("true") + '\n';
  for (const auto role : who.roles) text += std::string(to_string(role)) + ' ';
  if (const SiteList list = who.sites.sites())
    for (const auto& site : *list) text += "\n" + to_string(site);
  return hex_of(who.token_id, k_token_digits) + '-' + hex_of(who.token_id + '\n' + text, k_request_digits) +
         '-';
}

/// Newest first.
std::vector<Kept> all_in(const fs::path& folder) {
  std::vector<Kept> out;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    std::error_code gone;
    Kept one{entry.path(), entry.path().filename().string(), entry.file_size(gone), {}};
    if (!gone) one.used = entry.last_write_time(gone);
    if (!gone && one.name.size() == k_name_bytes) out.push_back(std::move(one));
  }
  std::ranges::sort(out, std::ranges::greater{}, &Kept::used);
  return out;
}

/// Those that are too old or too many; one that is being sent is sent to its end.
void drop(const fs::path& folder, const std::string& token) {
  const auto oldest = fs::file_time_type::clock::now() - k_kept_time;
  std::error_code error;
  const auto space = fs::space(folder, error);
  std::uint64_t free = error ? 0 : space.available, bytes = 0;
  std::size_t n = 0, of_token = 0;
  auto all = all_in(folder);
  for (const auto& one : all) {
    const bool own = one.name.starts_with(token);
    bytes += one.bytes;
    if (one.used < oldest || ++n > k_kept || bytes > k_kept_bytes || (own && ++of_token > k_kept_of_token))
      fs::remove(one.path, error);
  }
  std::ranges::reverse(all);
  for (const auto& one : all) {
    if (free >= k_free_bytes) break;
    if (fs::remove(one.path, error)) free += one.bytes;
  }
}

struct Span {
  std::uint64_t from{}, to{};  ///< the last byte is to - 1
};
/// One range of RFC 9110 section 14.2 that this server gives; nothing: the whole is sent. `from` beyond the
/// end cannot be given.
std::optional<Span> span_of(std::string_view text, std::uint64_t bytes) {
  if (!text.starts_with("bytes=")) return std::nullopt;
  text.remove_prefix(6);
  const auto hyphen = text.find('-');
  if (hyphen == std::string_view::npos) return std::nullopt;
  const auto number = [](std::string_view digits) -> std::optional<std::uint64_t> {
    std::uint64_t value = 0;
    const auto end = digits.data() + digits.size();
    const auto [at, error] = std::from_chars(digits.data(), end, value);
    return at == end && error == std::errc{} ? std::optional(value) : std::nullopt;
  };
  const auto first = text.substr(0, hyphen), last = text.substr(hyphen + 1);
  const auto a = number(first), b = number(last);
  if (first.empty() && b) return Span{*b == 0 ? bytes : bytes - std::min(*b, bytes), bytes};
  if (!a || (!last.empty() && (!b || *b < *a))) return std::nullopt;
  return Span{*a, last.empty() ? bytes : std::min(bytes, *b + (*b < bytes ? 1 : 0))};
}

struct Source {
  std::ifstream file;
  std::shared_ptr<SpoolFolder> folder;  ///< goes with the answer
  std::uint64_t left{};
};

/// The file, or the part of it that is asked for.
Response answer_of(const Request& request, const fs::path& path, const std::string& etag,
                   std::string_view type, const std::string& name, std::shared_ptr<SpoolFolder> folder) {
  const auto source = std::make_shared<Source>();
  source->file.open(path, std::ios::binary | std::ios::ate);
  if (!source->file)
    throw ProblemException{problem_of(make_error(Errc::storage_unavailable, "cannot read the bundle again"))};
  const auto bytes = static_cast<std::uint64_t>(source->file.tellg());
  const auto if_range = request.header("if-range");
  std::optional<Span> span;
  if (if_range.empty() || if_range == etag) span = span_of(request.header("range"), bytes);
  Response response;
  if (span && span->from >= bytes) {
    response = problem(416, "validation", "the bundle has " + std::to_string(bytes) + " bytes");
    response.header("Content-Range", "bytes */" + std::to_string(bytes));
    response.header("ETag", etag);
    return response;
  }
  response.header("Content-Type", std::string(type));
  response.header("Content-Disposition", "attachment; filename=\"" + name + '"');
  response.header("ETag", etag);
  response.header("Accept-Ranges", "bytes");
  if (span) {
    response.status = 206;
    response.header("Content-Range", "bytes " + std::to_string(span->from) + '-' +
                                         std::to_string(span->to - 1) + '/' + std::to_string(bytes));
  }
  const Span sent = span.value_or(Span{0, bytes});
  source->file.seekg(static_cast<std::streamoff>(sent.from));
  source->folder = std::move(folder);
  source->left = sent.to - sent.from;
  response.header("Content-Length", std::to_string(source->left));
  response.body_stream = [source] {
    std::string piece(static_cast<std::size_t>(std::min<std::uint64_t>(source->left, k_given_bytes)), '\0');
    if (!source->file.read(piece.data(), static_cast<std::streamsize>(piece.size())))
      throw std::runtime_error("cannot read a bundle that is being sent");
    source->left -= piece.size();
    return piece;
  };
  return response;
}

/// The file that is sent for it, with its ETag; where it cannot be kept, it stays where it is.
Result<Kept> keep(const fs::path& folder, const Request& request, const MadeBundle& made) {
  std::error_code error;
  fs::create_directories(folder, error);
  fs::permissions(folder, fs::perms::owner_all, error);
  const std::string key = key_of(request);
  for (auto& one : all_in(folder)) {
    if (!one.name.starts_with(key + made.digest)) continue;
    fs::last_write_time(one.path, fs::file_time_type::clock::now(), error);
    return one;
  }
  BOOST_OUTCOME_TRY(const auto entry, entry_of(made.name, made.file));
  Kept out{made.file, key + made.digest + '-' + entry.sha256_hex, entry.bytes, {}};
  fs::rename(made.file, folder / out.name, error);
  if (!error) out.path = folder / out.name;
  return out;
}

}  // namespace

std::optional<Response> kept_part(const fs::path& spool, const Request& request, std::string_view type,
                                  const std::string& name) {
  if (request.header("range").empty() || !request.header("if-none-match").empty()) return std::nullopt;
  const auto key = key_of(request);
  const auto if_range = request.header("if-range");
  for (const auto& one : all_in(folder_of(spool))) {
    if (!one.name.starts_with(key) || (!if_range.empty() && if_range != one.etag())) continue;
    std::error_code gone;
    fs::last_write_time(one.path, fs::file_time_type::clock::now(), gone);
    if (!gone) return answer_of(request, one.path, one.etag(), type, name, nullptr);
  }
  return std::nullopt;
}

Response bundle_answer(const fs::path& spool, const Request& request, std::shared_ptr<SpoolFolder> folder,
                       const MadeBundle& made) {
  const auto known = request.header("if-none-match");
  const auto kept = value_or_problem(keep(folder_of(spool), request, made));
  Response response;
  if (!known.empty() &&
      (etag_listed(known, kept.etag()) || etag_listed(known, "\"sha256:" + made.digest + '"'))) {
    response.status = 304;
    response.header("ETag", kept.etag());
  } else {
    response = answer_of(request, kept.path, kept.etag(), made.type, made.name, std::move(folder));
  }
  drop(folder_of(spool), kept.name.substr(0, k_token_digits));
  return response;
}

}  // namespace anchord::api
