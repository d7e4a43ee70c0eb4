#include "drivers/pozyx/conversation.hpp"

#include <algorithm>
#include <utility>

#include "drivers/pozyx/registers.hpp"

namespace anchord::pozyx {

bool Conversation::next_line() {
  line_ = lines_.next();
  return line_.has_value();
}

void Conversation::wait(std::coroutine_handle<> script, const Wait& wait) {
  waiting_ = script;
  kind_ = wait.kind;
  until_ns_ = wait.until_ns;
  silent_since_ns_ = now_ns_;
  line_.reset();
}

void Conversation::resume() {
  kind_ = Wait::Kind::none;
  if (const auto script = std::exchange(waiting_, nullptr)) script.resume();
}

void Conversation::bytes(std::string_view bytes, std::int64_t now_ns) {
  now_ns_ = now_ns;
  lines_.feed(bytes);
  silent_since_ns_ = now_ns;
  if (kind_ == Wait::Kind::line) {
    if (next_line()) resume();
    return;
  }
  // Nothing was asked: these are of an earlier question, or somebody else's.
  while (lines_.next()) ++counters_.stray_lines;
}

void Conversation::tick(std::int64_t now_ns) {
  now_ns_ = std::max(now_ns, now_ns_);
  if (const auto deadline = deadline_ns(); deadline && now_ns_ >= *deadline) resume();
}

std::optional<std::int64_t> Conversation::deadline_ns() const {
  switch (kind_) {
    case Wait::Kind::none:
      return std::nullopt;
    case Wait::Kind::line:
    case Wait::Kind::pause:
      return until_ns_;
    case Wait::Kind::silence:
      return std::min(until_ns_, silent_since_ns_ + quiet_ns_);
  }
  return std::nullopt;
}

void Conversation::wake() {
  if (kind_ == Wait::Kind::pause) resume();
}

Script<Result<Bytes>> Conversation::ask(std::string question, std::size_t answer_bytes) {
  while (lines_.next()) ++counters_.stray_lines;
  send_(question);
  const bool came = co_await Wait{*this, Wait::Kind::line, now_ns_ + options_.patience_ns};
  if (!came) {
    ++counters_.timeouts;
    co_return make_error(Errc::link_lost, "no answer to " + question.substr(0, question.size() - 1));
  }
  const std::string line = *line_;
  co_return parse_reply(line, answer_bytes);
}

Script<Result<Bytes>> Conversation::read(std::uint8_t address, std::size_t n) {
  if (!proven_) {
    const Result<void> proof = co_await resync();
    if (!proof) co_return proof.error();
  }
  Bytes out;
  for (const Chunk& chunk : chunks(address, n)) {
    const std::string question = read_line(chunk.address, chunk.size);
    Result<Bytes> part = co_await ask(question, chunk.size);
    if (!part) {
      const Error why = part.error();
      const Error error = co_await lost_track(why);
      co_return error;
    }
    out.insert(out.end(), part.value().begin(), part.value().end());
  }
  co_return out;
}

Script<Error> Conversation::lost_track(Error why) {
  if (why.code == Errc::bad_frame) ++counters_.bad_replies;
  const Result<void> proof = co_await resync();
  if (!proof) co_return proof.error();
  co_return why;
}

void Conversation::write(std::uint8_t address, ByteView data) {
  for (const Chunk& chunk : chunks(address, data.size()))
    send_(write_line(chunk.address, data.subspan(chunk.offset, chunk.size)));
}

Script<Result<Bytes>> Conversation::call(std::uint8_t function, Bytes parameters, std::size_t result_bytes) {
  if (!proven_) {
    const Result<void> proof = co_await resync();
    if (!proof) co_return proof.error();
  }
  const std::string question = function_line(function, parameters, result_bytes + 1);
  Result<Bytes> reply = co_await ask(question, result_bytes + 1);
  if (reply && reply.value().front() == 1) {
    reply.value().erase(reply.value().begin());
    co_return reply;
  }
  // A refusal is a status of 00, with or without the rest. A late answer to "any event?" is "D,00" too: only
  // proof that answers belong to questions tells them apart.
  const bool perhaps_refused = reply || (line_ && line_->starts_with("D,00") && line_->size() % 2 == 0);
  if (perhaps_refused) {
    const std::string proof = read_line(reg::who_am_i, 1);
    Result<Bytes> who = co_await ask(proof, 1);
    if (who && who.value().front() == k_who_am_i) {
      co_return make_error(Errc::conflict, "the tag rejects " + question.substr(0, question.size() - 1));
    }
  }
  Error why = make_error(Errc::bad_frame, "an answer to another request");
  if (!reply) why = reply.error();
  const Error error = co_await lost_track(why);
  co_return error;
}

Script<Result<void>> Conversation::open() {
  co_await pause(options_.settle_ns);
  Result<void> proven = co_await resync();
  co_return proven;
}

Script<Result<void>> Conversation::resync() {
  ++counters_.resyncs;
  proven_ = false;
  constexpr int k_tries = 3;
  quiet_ns_ = options_.quiet_ns;
  for (int i = 0; i < k_tries; ++i) {
    co_await Wait{*this, Wait::Kind::silence, now_ns_ + options_.drain_ns};
    lines_.clear();
    // An empty line first: it ends whatever the tag has of a broken question.
    std::string question = read_line(reg::who_am_i, 1);
    if (i > 0) question.insert(0, "\r");
    Result<Bytes> who = co_await ask(question, 1);
    if (who && who.value().front() == k_who_am_i) {
      proven_ = true;
      co_return boost::outcome_v2::success();
    }
    quiet_ns_ = options_.patience_ns + options_.quiet_ns;  // its answers are slower than thought
  }
  co_return make_error(Errc::link_lost, "no Pozyx tag answers on this port");
}

}  // namespace anchord::pozyx
