// Bundles on their way, over a link that is cut.
#include "server/sync/transfer.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "core/base/ids.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"
#include "server/runtime/private_file.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using server::ClientResponse;
using Monotonic = std::chrono::steady_clock;

constexpr std::uint64_t k_whole_bytes = std::uint64_t{128} << 10;  ///< below, parts only cost their questions
/// 2 s of a link of 256 kbit/s, which a proxy that keeps bodies may lose; one that nobody configured lets it
/// through (nginx: 1 MiB).
constexpr std::uint64_t k_first_part_bytes = std::uint64_t{64} << 10;
constexpr std::uint64_t k_largest_part_bytes = std::uint64_t{32} << 20;
constexpr std::chrono::seconds k_quick{2};  ///< a part that goes faster is followed by one of twice its size
constexpr int k_most_rounds = 3;
constexpr std::chrono::hours k_part_time{7 * 24};
constexpr std::string_view k_part_name = "sync-part-";
constexpr std::size_t k_most_etag_bytes = 300;
constexpr std::size_t k_key_digits = 32, k_digest_digits = 64;

std::string header_of(const ClientResponse& answer, const char* name) {
  const auto at = answer.headers.find(name);
  return at == answer.headers.end() ? std::string() : at->second;
}

/// A bundle of the centre that is not whole yet: a file, and one with its ETag.
class Download {
 public:
  Download(Run& run, Peer& peer, std::string target, std::string known)
      : run_(run), peer_(peer), target_(std::move(target)), known_(std::move(known)) {
    Sha256 sum;
    sum.add(peer.url() + '\n' + target_);
    path_ =
        run.options.state_file.parent_path() / (std::string(k_part_name) + sum.hex().substr(0, k_key_digits));
  }

  Result<Fetched> fetch() {
    BOOST_OUTCOME_TRY(auto file, open());
    for (int round = 0;; ++round) {
      bool went_on = false;
      auto answer = peer_.go_on(
          [&] {
            const auto at = etag_.empty() ? 0 : file.bytes();
            went_on = went_on || at > 0;
            return ask(file, at);
          },
          [&] { return file.bytes(); });
      if (!answer) return answer.error();
      if (answer.value().status == 206) answer.value().status = 200;
      if (answer.value().status == 416 &&
          header_of(answer.value(), "content-range") == "bytes */" + std::to_string(file.bytes()))
        answer.value().status = 200;  // the last byte came, but not its end
      const bool right = answer.value().status == 200 && is_right(file);
      if (!right && went_on && round == 0 && (answer.value().status == 200 || answer.value().status == 416)) {
        forget();
        continue;
      }
      forget();
      remove_file();
      if (answer.value().status == 200 && !right)
        return peer_.stranger(target_, "the bundle does not have the SHA-256 of its ETag");
      return Fetched{std::move(answer).value(), std::move(file)};
    }
  }

 private:
  Result<Spool> open() {
    if (&peer_ == &run_.centre) {
      if (auto named = Spool::named(path_)) {
        named_ = true;
        std::ifstream in(etag_path(), std::ios::binary);
        etag_ = std::string(std::istreambuf_iterator<char>(in), {});
        if (etag_.size() > k_most_etag_bytes || !etag_.starts_with('"')) etag_.clear();
        return named;
      }
    }
    return Spool::make(run_.options.state_file.parent_path());
  }
  fs::path etag_path() const { return path_.string() + ".etag"; }

  Result<ClientResponse> ask(const Spool& file, std::uint64_t at) {
    PeerRequest request{.method = "GET",
                        .target = target_,
                        .into = &file,
                        .into_at = at,
                        .most_bytes = k_most_bundle_bytes - std::min(at, k_most_bundle_bytes),
                        .bundle = true,
                        .once = true};
    request.begins = [this](const ClientResponse& head) { return begins(head); };
    if (!known_.empty()) request.headers.emplace("If-None-Match", "\"sha256:" + known_ + '"');
    if (at > 0) {
      request.headers.emplace("Range", "bytes=" + std::to_string(at) + '-');
      request.headers.emplace("If-Range", etag_);
    }
    return peer_.call(request);
  }

  /// What is written from here on is of this ETag; without one it is of no use to a later request.
  Result<void> begins(const ClientResponse& head) {
    const auto etag = header_of(head, "etag");
    if (head.status == 206 && etag == etag_) return boost::outcome_v2::success();
    if (head.status == 206)
      return make_error(Errc::bad_frame, "the answer is a part of other bytes than was asked for");
    etag_ = etag.starts_with('"') && etag.size() <= k_most_etag_bytes ? etag : "";
    if (!named_) return boost::outcome_v2::success();
    return server::write_private(etag_path(), etag_);
  }

  /// By the digest in an ETag of this server's kind; others name nothing that could be compared.
  bool is_right(const Spool& file) const {
    const auto dot = etag_.rfind('.');
    if (!etag_.starts_with("\"sha256:") || dot == std::string::npos ||
        etag_.size() != dot + 1 + k_digest_digits + 1)
      return true;
    const auto digest = digest_of(file);
    return digest && digest.value() == etag_.substr(dot + 1, k_digest_digits);
  }

  void forget() {
    etag_.clear();
    std::error_code gone;
    if (named_) fs::remove(etag_path(), gone);
  }
  void remove_file() const {
    std::error_code gone;
    if (named_) fs::remove(path_, gone);
  }

  Run& run_;
  Peer& peer_;
  const std::string target_, known_;
  fs::path path_;
  bool named_{false};
  std::string etag_;  ///< of what the file has; empty: it cannot be gone on with
};

class Sending {
 public:
  Sending(Run& run, const Spool& file, std::string_view type)
      : run_(run), target_(run.target()), file_(file), type_(type), bytes_(file.bytes()) {}

  Result<ClientResponse> send() {
    if (bytes_ < k_whole_bytes || !run_.up() || !run_.in_parts) return whole();
    BOOST_OUTCOME_TRY(sha256_, digest_of(file_));
    for (int round = 0;; ++round) {
      BOOST_OUTCOME_TRY(auto begun, begin());
      if (begun.status == 404 || begun.status == 405) {
        run_.in_parts = false;
        run_.report(target_.url() +
                    " does not take bundles in parts (it is older than this program): a bundle that is cut "
                    "off begins again");
        return whole();
      }
      if (begun.status != 200 && begun.status != 201) return begun;
      BOOST_OUTCOME_TRYV(read(json_of(begun)));
      if (offset_ > 0 && offset_ < bytes_)
        run_.report("going on after " + megabytes(offset_) + " of " + megabytes(bytes_));
      BOOST_OUTCOME_TRY(auto sent, target_.go_on([&] { return parts(); }, [&] { return offset_; }));
      if (offset_ == bytes_) {
        BOOST_OUTCOME_TRY(sent, target_.call({.method = "POST", .target = path("/import"), .bundle = true}));
        if (sent.status == 200 || sent.status == 201)
          (void)target_.call({.method = "DELETE", .target = path(), .once = true});  // else it expires
      }
      // It gave way to another, or did not have its digest: from its beginning.
      if ((sent.status != 404 && sent.status != 422) || round == k_most_rounds) return sent;
      if (sent.status == 422 && round > 0) return sent;
    }
  }

 private:
  Result<ClientResponse> whole() {
    return target_.call(
        {.method = "POST", .target = "/api/v1/bundles", .type = type_, .from = &file_, .bundle = true});
  }
  std::string path(std::string_view rest = {}) const { return path_of("bundles/uploads", id_, rest); }

  Result<ClientResponse> begin() {
    const auto body = to_wire(Json{{"bytes", bytes_}, {"sha256", sha256_}});
    return target_.call({"POST", "/api/v1/bundles/uploads", body});
  }
  Result<void> read(const Json& upload) {
    const auto& offset = member(upload, "offset");
    id_ = text_of(upload, "id");
    if (!parse_uuid(id_) || text_of(upload, "sha256") != sha256_ || !offset.is_number_unsigned() ||
        offset.get<std::uint64_t>() > bytes_)
      return target_.stranger("/api/v1/bundles/uploads",
                              "the answer does not belong to the bundle that was sent");
    offset_ = offset.get<std::uint64_t>();
    return boost::outcome_v2::success();
  }

  /// The parts from the offset on, until one is refused.
  Result<ClientResponse> parts() {
    if (asks_) {
      BOOST_OUTCOME_TRY(auto now, target_.call({.method = "GET", .target = path(), .once = true}));
      if (now.status != 200) return now;
      part_bytes_ = k_first_part_bytes;
      BOOST_OUTCOME_TRYV(read(json_of(now)));
    }
    asks_ = true;
    ClientResponse last;
    last.status = 204;
    while (offset_ < bytes_) {
      const auto began = Monotonic::now();
      PeerRequest part{.method = "PATCH",
                       .target = path(),
                       .type = "application/offset+octet-stream",
                       .from = &file_,
                       .from_at = offset_,
                       .from_bytes = std::min(part_bytes_, bytes_ - offset_),
                       .bundle = true,
                       .once = true};
      part.headers.emplace("Upload-Offset", std::to_string(offset_));
      BOOST_OUTCOME_TRY(last, target_.call(part));
      if (last.status == 413 && part_bytes_ > k_first_part_bytes) {
        largest_ = part_bytes_ = k_first_part_bytes;
        continue;
      }
      if (last.status == 409)  // bytes of before a cut arrived meanwhile
        return make_error(Errc::link_lost, target_.url() + ": " + sync::in_words(last));
      if (last.status != 204) return last;
      const auto expected = offset_ + *part.from_bytes;
      if (header_of(last, "upload-offset") != std::to_string(expected))
        return target_.stranger(path(), "the answer does not belong to the part that was sent");
      offset_ = expected;
      if (Monotonic::now() - began < k_quick) part_bytes_ = std::min(part_bytes_ * 2, largest_);
    }
    return last;
  }

  Run& run_;
  Peer& target_;
  const Spool& file_;
  const std::string_view type_;
  const std::uint64_t bytes_;
  std::string sha256_, id_;
  std::uint64_t offset_{}, part_bytes_{k_first_part_bytes}, largest_{k_largest_part_bytes};
  bool asks_{false};  ///< for the offset, after a cut
};

}  // namespace

Result<Fetched> fetch_bundle(Run& run, Peer& peer, const std::string& target, const std::string& known) {
  return Download(run, peer, target, known).fetch();
}

Result<ClientResponse> send_bundle(Run& run, const Spool& file, std::string_view type) {
  return Sending(run, file, type).send();
}

void remove_old_parts(const Run& run) {
  const auto folder = run.options.state_file.parent_path();
  const auto oldest = fs::file_time_type::clock::now() - k_part_time;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, error)) {
    std::error_code gone;
    if (entry.path().filename().string().starts_with(k_part_name) && entry.last_write_time(gone) < oldest)
      fs::remove(entry.path(), gone);
  }
}

}  // namespace anchord::sync
