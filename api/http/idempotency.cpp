#include "api/http/idempotency.hpp"

#include <openssl/evp.h>

#include <array>

#include "api/http/problem.hpp"
#include "api/http/router.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {
namespace {

constexpr std::int64_t k_keep_ns = 24LL * 3600 * 1'000'000'000;

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  void add(std::string_view bytes) { EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()); }
  std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    std::string text;
    for (unsigned i = 0; i < size; ++i) {
      text += "0123456789abcdef"[digest[i] >> 4];
      text += "0123456789abcdef"[digest[i] & 15];
    }
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

/// Hashes a streamed body on its way through.
class HashingReader final : public BodyReader {
 public:
  HashingReader(BodyReader& inner, Sha256& hash) : inner_(inner), hash_(hash) {}
  std::size_t read(std::span<char> buffer) override {
    const std::size_t n = inner_.read(buffer);
    hash_.add({buffer.data(), n});
    return n;
  }

 private:
  BodyReader& inner_;
  Sha256& hash_;
};

void drain(BodyReader& reader) {
  std::array<char, 16384> buffer{};
  while (reader.read(buffer) != 0) {
  }
}

/// Releases the key when the request ends, however it ends.
class Running {
 public:
  Running(std::mutex& mutex, std::set<std::string>& set, std::string name)
      : mutex_(mutex), set_(set), name_(std::move(name)) {
    const std::scoped_lock lock(mutex_);
    first_ = set_.insert(name_).second;
  }
  ~Running() {
    const std::scoped_lock lock(mutex_);
    if (first_) set_.erase(name_);
  }
  bool first() const { return first_; }

 private:
  std::mutex& mutex_;
  std::set<std::string>& set_;
  std::string name_;
  bool first_{false};
};

}  // namespace

std::string sha256_hex(std::string_view bytes) {
  Sha256 hash;
  hash.add(bytes);
  return hash.hex();
}

Response Idempotency::run(Request& request, const std::function<Response(Request&)>& handler) {
  const std::string key(request.header("idempotency-key"));
  if (key.size() > 128) return problem(400, "malformed", "Idempotency-Key is longer than 128 characters");
  const std::string& who = request.principal.token_id;
  const Running running(mutex_, running_, who + '\n' + key);
  if (!running.first())
    return problem(409, "conflict", "a request with this Idempotency-Key is still running");

  Sha256 hash;
  hash.add(to_string(request.method));
  hash.add(request.path);
  for (const auto& [name, value] : request.query) hash.add("\n" + name + "=" + value);
  hash.add("\n\n");

  auto stored = answers_.answer(who, key);
  if (!stored) return problem_of(stored.error());
  const auto& kept = stored.value();
  if (kept && clock_.now().ns - kept->created.ns < k_keep_ns) {
    if (request.body_stream != nullptr) {
      HashingReader reader(*request.body_stream, hash);
      drain(reader);
    } else {
      hash.add(request.body);
    }
    if (hash.hex() != kept->request_sha256_hex) {
      return problem(422, "validation", "this Idempotency-Key was used with another request",
                     {{"", "idempotency_key", "the key belongs to a request with other content"}});
    }
    Response response;
    response.status = kept->status;
    response.header("Content-Type", kept->status >= 400 ? "application/problem+json" : "application/json");
    if (!kept->location.empty()) response.header("Location", kept->location);
    if (!kept->etag.empty()) response.header("ETag", kept->etag);
    response.header("Idempotent-Replayed", "true");
    response.body = kept->body;
    return response;
  }

  Response response;
  if (request.body_stream != nullptr) {
    HashingReader reader(*request.body_stream, hash);
    request.body_stream = &reader;
    response = handler(request);
    drain(reader);
    request.body_stream = nullptr;
  } else {
    hash.add(request.body);
    response = handler(request);
  }
  if (response.status < 500 && !response.body_stream) {
    StoredAnswer answer{key, who, hash.hex(), response.body, {}, {}, response.status, clock_.now()};
    for (const auto& [name, value] : response.headers) {
      if (name == "Location") answer.location = value;
      if (name == "ETag") answer.etag = value;
    }
    auto saved = answers_.keep_answer(answer);
    if (!saved) return problem_of(saved.error());
  }
  return response;
}

}  // namespace anchord::api
