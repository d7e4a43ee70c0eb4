#include "api/kit/idempotency.hpp"

#include <array>
#include <limits>

#include "api/kit/problem.hpp"
#include "api/kit/router.hpp"
#include "core/base/sha256.hpp"
#include "core/ports/access_store.hpp"
#include "core/ports/request_mark.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_purged_at_once = 200;

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
  Running(Locked<std::set<std::string>>& all, std::string name) : all_(all), name_(std::move(name)) {
    auto set = all_.lock();
    first_ = set->insert(name_).second;
  }
  ~Running() {
    auto set = all_.lock();
    if (first_) set->erase(name_);
  }
  bool first() const { return first_; }

 private:
  Locked<std::set<std::string>>& all_;
  std::string name_;
  bool first_{false};
};

using Handler = std::function<Response(Request&)>;

/// By `handler`. Cut off behind something that it wrote, by the end of this server or of the database's
/// connection, it leaves a mark: it is not done again.
Response handled(AccessStore& answers, std::int64_t ran_ns, Request& request, Keeps keeps,
                 const Handler& handler) {
  // Rows have identities and commands numbers of their own: they may be sent again.
  if (keeps == Keeps::always) return handler(request);
  StoredAnswer begun;
  begun.key = std::string(request.header("idempotency-key"));
  begun.principal = request.principal.token_id;
  begun.created_ran_ns = ran_ns;
  Response response;
  {
    const RequestMark mark(begun);
    response = handler(request);
  }
  // Rejected after all: what it wrote until then is no answer, and it may be sent again.
  if (response.status >= 400 && response.status < 500) {
    const auto left = answers.answer(begun.principal, begun.key);
    begun.created_ran_ns = std::numeric_limits<std::int64_t>::min() / 2;
    if (left && left.value() && left.value()->status == 0)
      (void)answers.keep_answer(begun, begun.created_ran_ns).has_value();
  }
  return response;
}

}  // namespace

std::string sha256_hex(std::string_view bytes) {
  Sha256 hash;
  hash.add(bytes);
  return hash.hex();
}

AnswerUse Idempotency::use_of(const std::string& who) {
  {
    const auto use = use_.lock();
    if (const auto at = use->find(who); at != use->end()) return at->second;
  }
  const auto stored = answers_.answer_use(who);
  auto use = use_.lock();
  return use->emplace(who, stored ? stored.value() : AnswerUse{}).first->second;
}

Idempotency::Room Idempotency::make_room(const std::string& who, Keeps keeps) {
  const AnswerUse use = use_of(who);
  if (use.count < k_max_answers && use.bytes < k_max_bytes) return {};
  if (keeps == Keeps::answer) {
    return {true, "this token has " + std::to_string(use.count) + " stored answers of " +
                      std::to_string(use.bytes) + " bytes of the last 24 h (limits " +
                      std::to_string(k_max_answers) + " and " + std::to_string(k_max_bytes) +
                      "): send the request without Idempotency-Key, or later"};
  }
  (void)answers_.drop_oldest_answers(who, k_max_answers / 10).has_value();
  auto counted = use_.lock();
  counted->erase(who);
  return {};
}

void Idempotency::keep(const Request& request, const Response& response, std::string hash) {
  StoredAnswer answer;
  answer.key = std::string(request.header("idempotency-key"));
  answer.principal = request.principal.token_id;
  answer.request_sha256_hex = std::move(hash);
  answer.status = response.status;
  answer.created_ran_ns = running_ns_();
  for (const auto& [name, value] : response.headers) {
    if (name == "Location") answer.location = value;
    if (name == "ETag") answer.etag = value;
  }
  if (response.body.size() <= k_max_answer_bytes) {
    answer.body = response.body;
  } else {
    answer.body = R"({"replayed":true,"detail":"the first request was carried out; its answer of )" +
                  std::to_string(response.body.size()) + " bytes was not kept (limit " +
                  std::to_string(k_max_answer_bytes) + R"(): read the resource itself"})";
  }
  // It was done, whatever becomes of this: an error here would tell the client that it was not.
  if (!answers_.keep_answer(answer, answer.created_ran_ns - k_keep_ns)) return;
  auto use = use_.lock();
  if (const auto at = use->find(answer.principal); at != use->end()) {
    ++at->second.count;
    at->second.bytes += answer.body.size();
  }
}

void Idempotency::forget_use() {
  auto use = use_.lock();
  use->clear();
}

bool Idempotency::purge() {
  const auto dropped = answers_.drop_answers_before(running_ns_() - k_keep_ns, k_purged_at_once);
  forget_use();
  return dropped && dropped.value() == k_purged_at_once;
}

Response Idempotency::run(Request& request, Keeps keeps, const std::function<Response(Request&)>& handler) {
  const std::string key(request.header("idempotency-key"));
  if (key.size() > 128) return problem(400, "malformed", "Idempotency-Key is longer than 128 characters");
  const std::string& who = request.principal.token_id;
  const Running running(running_, who + '\n' + key);
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
  if (kept && running_ns_() - kept->created_ran_ns < k_keep_ns) {
    if (kept->status == 0)
      return problem(
          409, "conflict",
          "the first request with this Idempotency-Key was carried out, at least in part, and its answer "
          "was lost with its server: read what is there, and send what is missing with another key");
    if (request.body_stream != nullptr) {
      HashingReader reader(*request.body_stream, hash);
      drain(reader);
    } else {
      hash.add(request.body);
    }
    if (hash.hex() != kept->request_sha256_hex) {
      return problem(422, "validation", "this Idempotency-Key was already used with another request",
                     {{"", "idempotency_key", "the key belongs to a request with other content"}});
    }
    Response response;
    response.status = kept->status;
    response.header("Content-Type", "application/json");
    if (!kept->location.empty()) response.header("Location", kept->location);
    if (!kept->etag.empty()) response.header("ETag", kept->etag);
    response.header("Idempotent-Replayed", "true");
    response.body = kept->body;
    return response;
  }
  if (const Room room = make_room(who, keeps); room.refused) {
    Response response = problem(429, "quota", room.why);
    for (auto& [name, value] : response.headers) {
      if (name == "Retry-After") value = "3600";
    }
    return response;
  }

  Response response;
  if (request.body_stream != nullptr) {
    HashingReader reader(*request.body_stream, hash);
    request.body_stream = &reader;
    response = handled(answers_, running_ns_(), request, keeps, handler);
    drain(reader);
    request.body_stream = nullptr;
  } else {
    hash.add(request.body);
    response = handled(answers_, running_ns_(), request, keeps, handler);
  }
  if (response.status < 400 && !response.body_stream) keep(request, response, hash.hex());
  return response;
}

}  // namespace anchord::api
