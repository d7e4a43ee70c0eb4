#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/base/guard.hpp"
#include "server/http/body_pipe.hpp"
#include "server/http/http_wire.hpp"
#include "server/http/request_check.hpp"
#include "server/http/request_id.hpp"
#include "server/http/response_writer.hpp"
#include "server/http/sessions.hpp"
#include "server/runtime/worker_pool.hpp"

namespace anchord::server {
namespace {

using SteadyClock = std::chrono::steady_clock;
template <class T>
using awaitable = asio::awaitable<T>;

constexpr std::size_t k_piece_bytes = 16 * 1024;
constexpr int k_most_proxies = 4;  // in a row that speak the PROXY protocol

enum class BodyEnd : std::uint8_t { complete, lost, refused };

/// One HTTP connection. Everything runs on the strand of its socket; handlers run on the pools and ring
/// `bell_`.
class HttpSession final : public Connection, public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(tcp::socket socket, std::shared_ptr<SessionContext> context, ConnectionSlot slot, bool tls)
      : wire_(std::move(socket), context->limits),
        bell_(wire_.executor()),
        context_(std::move(context)),
        slot_(std::move(slot)),
        limits_(context_->limits),
        tls_(tls),
        pool_(&context_->pools.ordinary),
        peer_(wire_.remote()),
        remote_(peer_) {}
  ~HttpSession() override {
    context_->book.busy(this);
    context_->leave(this);
  }

  static awaitable<void> run(std::shared_ptr<HttpSession> self) {
    self->context_->enter(self.get(), self->weak_from_this());
    const bool known = co_await self->settle_client();
    if (!known) co_return;
    if (self->tls_) {
      const bool secured = co_await self->secure();
      if (!secured) co_return;
    }
    bool first = true;
    while (co_await self->serve_one(first)) first = false;
  }

  void stop() override {
    asio::post(wire_.executor(), [self = shared_from_this()] {
      if (self->wire_.idle()) self->close();
    });
  }
  void evict() override {
    asio::post(wire_.executor(), [self = shared_from_this()] {
      if (self->awaits_head_) self->close();
    });
  }
  void abort() override {
    asio::post(wire_.executor(), [self = shared_from_this()] { self->close(); });
  }

 private:
  void close() {
    wire_.close();
    bell_.cancel();
  }

  /// A trusted proxy may say for whom it connects, which may be another one of them.
  awaitable<bool> settle_client() {
    for (int hop = 0; hop < k_most_proxies && context_->is_proxy && context_->is_proxy(remote_); ++hop) {
      awaits_head_ = true;
      context_->book.idle(peer_, this, weak_from_this());
      const auto header = co_await wire_.take_proxy_header();
      awaits_head_ = false;
      context_->book.busy(this);
      if (!header) co_return false;
      if (!header->client) break;
      remote_ = *header->client;
    }
    co_return true;
  }

  /// Keys are exchanged. Until then it is one of those that go first when places run out.
  awaitable<bool> secure() {
    awaits_head_ = true;
    context_->book.idle(peer_, this, weak_from_this());
    const bool secured = co_await wire_.secure(context_->tls->begin());
    awaits_head_ = false;
    context_->book.busy(this);
    if (!secured && !context_->stopping) ++context_->failed_handshakes;
    co_return secured;
  }

  /// Handlers believe this header: it is a trusted proxy's word, or ours, and nobody else's.
  void settle_scheme() {
    auto& headers = request_->headers;
    const bool proxy = context_->is_proxy && context_->is_proxy(remote_);
    if (!proxy) headers.erase("x-forwarded-proto");
    if (tls_) headers.try_emplace("x-forwarded-proto", "https");
  }

  /// One request and its answer. False: the connection is finished.
  awaitable<bool> serve_one(bool first) {
    awaits_head_ = true;
    context_->book.idle(peer_, this, weak_from_this());
    const HttpWire::Head head = co_await wire_.read_head(first, context_->stopping);
    awaits_head_ = false;
    context_->book.busy(this);
    started_ = SteadyClock::now();
    if (head.refusal) co_await refuse(*head.refusal);
    if (head.size == 0) co_return false;
    RequestParser parser(limits_);
    auto broken = parser.parse_head(wire_.buffered().substr(0, head.size));
    HeadCheck judgement;
    if (broken) {
      judgement = std::move(*broken);
    } else {
      judgement = validate_head(parser.head(), limits_, context_->hosts);
    }
    wire_.consume(head.size);
    if (auto* refusal = std::get_if<Refusal>(&judgement)) {
      co_await refuse(*refusal);
      co_return false;
    }
    auto& judged = std::get<ValidHead>(judgement);
    request_ = std::make_shared<api::Request>(std::move(judged.request));
    request_->request_id = request_id_of(request_->header("x-request-id"));
    request_->remote = remote_;
    settle_scheme();
    Admission admission = context_->gateway.admit(*request_, judged.host, judged.websocket);
    route_ = admission.route;
    if (admission.websocket && !admission.refusal) {
      if (!wire_.buffered().empty()) {
        const Refusal early{400, "malformed", "data before the WebSocket handshake was answered"};
        co_await refuse(early);
        co_return false;
      }
      auto peer = admission.websocket();
      context_->gateway.answered(*request_, route_, 101, seconds(), 0);
      start_ws_session(wire_.take(), context_, std::move(slot_), *request_, admission.subprotocol,
                       std::move(peer));
      co_return false;
    }
    co_return co_await exchange(parser, judged, admission);
  }

  awaitable<bool> exchange(RequestParser& parser, ValidHead& judged, Admission& admission) {
    const std::uint64_t limit = admission.refusal ? limits_.drain_bytes : admission.body_limit;
    const bool too_large = judged.framing == Framing::length && judged.content_length > limit;
    bool keep = judged.keep_alive;
    api::Response response;
    if (admission.refusal && (too_large || judged.expects_continue)) {
      response = std::move(*admission.refusal);
      keep = keep && judged.framing == Framing::none;
    } else if (too_large) {
      response = context_->gateway.problem(
          413, "too-large", "the body may have at most " + std::to_string(limit) + " bytes here");
      keep = false;
    } else {
      if (judged.expects_continue && wire_.buffered().empty()) {
        const std::string go_on = "HTTP/1.1 100 Continue\r\n\r\n";
        const bool sent = co_await wire_.write(go_on, {});
        if (!sent) co_return false;
      }
      BodyEnd end = BodyEnd::complete;
      if (admission.streams_body && !admission.refusal) {
        end = co_await stream_to_handler(parser, admission, response);
      } else {
        std::string sink;
        end = co_await read_body(parser, judged, limit, admission.refusal ? sink : request_->body);
        if (end == BodyEnd::complete) {
          if (admission.refusal) {
            response = std::move(*admission.refusal);
          } else {
            co_await run_handler(admission, response);
          }
        }
      }
      if (end == BodyEnd::lost) co_return false;
      if (end == BodyEnd::refused) {
        co_await refuse(refusal_);
        co_return false;
      }
      keep = keep && parser.done();
    }
    co_return co_await answer(response, judged, keep);
  }

  BodyEnd ended(const HttpWire::Piece& piece) {
    if (!piece.refusal) return BodyEnd::lost;
    refusal_ = *piece.refusal;
    return BodyEnd::refused;
  }

  awaitable<BodyEnd> read_body(RequestParser& parser, const ValidHead& judged, std::uint64_t limit,
                               std::string& body) {
    if (parser.done()) co_return BodyEnd::complete;
    wire_.expect_body();
    RateFloor floor(SteadyClock::now(), limits_.body_window, limits_.body_floor_bytes_per_s);
    if (judged.framing == Framing::length)
      body.reserve(std::min<std::uint64_t>(judged.content_length, 1u << 20));
    while (!parser.done()) {
      const std::size_t at = body.size();
      body.resize(at + k_piece_bytes);
      const auto got = co_await wire_.next_piece(parser, floor, {body.data() + at, k_piece_bytes});
      body.resize(at + got.produced);
      if (!got.more()) co_return ended(got);
      if (body.size() > limit) {
        refusal_ =
            Refusal{413, "too-large", "the body may have at most " + std::to_string(limit) + " bytes here"};
        co_return BodyEnd::refused;
      }
    }
    co_return BodyEnd::complete;
  }

  /// Feeds a handler that reads while the body arrives. The handler starts when the pipe is full or the body
  /// whole, so that small uploads on a slow link never hold a thread.
  awaitable<BodyEnd> stream_to_handler(RequestParser& parser, Admission& admission, api::Response& response) {
    const auto pipe = std::make_shared<BodyPipe>(limits_.body_pipe_bytes);
    pipe->on_space([weak = weak_from_this()] {
      if (auto self = weak.lock()) self->ring();
    });
    request_->body_stream = pipe.get();
    wire_.expect_body();
    RateFloor floor(SteadyClock::now(), limits_.body_window, limits_.body_floor_bytes_per_s);
    const auto piece = std::make_unique_for_overwrite<char[]>(k_piece_bytes);
    std::shared_ptr<Job> job;
    BodyEnd end = BodyEnd::complete;
    std::uint64_t total = 0;
    while (!parser.done() && !pipe->abandoned()) {
      const std::size_t space = pipe->space();
      if (space == 0) {
        if (!job) job = submit(context_->pools.uploads, admission.run, pipe);
        if (!job) break;
        const auto before = SteadyClock::now();
        while (pipe->space() == 0 && !job->done) co_await wait_for_bell();
        floor.waited(SteadyClock::now() - before);
        continue;
      }
      const auto got =
          co_await wire_.next_piece(parser, floor, {piece.get(), std::min(space, k_piece_bytes)});
      if (!got.more()) {
        end = ended(got);
        if (end == BodyEnd::lost) {
          pipe->fail(400, "the connection ended, or fell below 1 KiB/s, inside the body");
        } else {
          pipe->fail(refusal_.status, refusal_.detail);
        }
        break;
      }
      total += got.produced;
      if (total > admission.body_limit) {
        refusal_ =
            Refusal{413, "too-large",
                    "the body may have at most " + std::to_string(admission.body_limit) + " bytes here"};
        pipe->fail(413, refusal_.detail);
        end = BodyEnd::refused;
        break;
      }
      pipe->feed({piece.get(), got.produced});
    }
    if (parser.done()) pipe->finish();
    // What came of a part that a cut ended is not sent again (upload_routes.cpp).
    const bool kept = end == BodyEnd::lost && request_->headers.contains("upload-offset");
    if (!job && ((end == BodyEnd::complete && parser.done()) || kept))
      job = submit(context_->pools.uploads, admission.run, pipe);
    if (!job) {
      if (end == BodyEnd::complete) response = overloaded();
      co_return end;
    }
    while (!job->done) co_await wait_for_bell();
    // A handler that saw the failure answers with what it stored before; that is worth more than our own
    // words.
    if (end == BodyEnd::refused) end = BodyEnd::complete;
    response = std::move(job->response);
    co_return end;
  }

  struct Job {
    api::Response response;
    bool done{false};  ///< read and written on the strand only
  };

  /// Null: the pool is full.
  std::shared_ptr<Job> submit(WorkerPool& pool, std::function<api::Response(api::Request&)> run,
                              std::shared_ptr<BodyPipe> pipe) {
    auto job = std::make_shared<Job>();
    const bool taken =
        pool.try_submit([job, self = shared_from_this(), run = std::move(run), pipe = std::move(pipe),
                         request = request_, from = limits_.gzip_from_bytes] {
          job->response = self->handle(run, *request);
          if (pipe) pipe->abandon();
          gzip_response(job->response, request->header("accept-encoding"), from);
          asio::post(self->wire_.executor(), [job, self] {
            job->done = true;
            self->bell_.cancel();
          });
        });
    return taken ? job : nullptr;
  }

  api::Response handle(const std::function<api::Response(api::Request&)>& run, api::Request& request) {
    api::Response response;
    const auto ran = guarded("request", [&] { response = run(request); });
    return ran ? std::move(response) : context_->gateway.problem(500, "internal", "");
  }

  api::Response overloaded() {
    return context_->gateway.problem(503, "overloaded", "too many requests are waiting");
  }

  awaitable<void> run_handler(Admission& admission, api::Response& response) {
    if (admission.quick) {
      response = handle(admission.run, *request_);
      gzip_response(response, request_->header("accept-encoding"), limits_.gzip_from_bytes);
      co_return;
    }
    const api::Work work = admission.work ? admission.work(*request_) : api::Work::ordinary;
    pool_ = &context_->pools.of(work);
    if (work == api::Work::heavy && !admission.share.empty()) {
      share_ = context_->heavy_shares.take(admission.share);
      if (!share_) {
        response = context_->gateway.problem(
            429, "rate-limited",
            "this token has " + std::to_string(context_->heavy_shares.per_name()) +
                " computations or large answers running; wait until one of them has ended");
        co_return;
      }
    }
    const auto job = submit(*pool_, admission.run, nullptr);
    if (!job) {
      response = overloaded();
      co_return;
    }
    while (!job->done) co_await wait_for_bell();
    response = std::move(job->response);
  }

  void ring() {
    asio::post(wire_.executor(), [self = shared_from_this()] { self->bell_.cancel(); });
  }
  awaitable<void> wait_for_bell() {
    bell_.expires_at(SteadyClock::time_point::max());
    co_await bell_.async_wait(k_wait);
  }

  awaitable<bool> answer(api::Response& response, const ValidHead& judged, bool keep) {
    const bool http_1_0 = judged.version == 10;
    const bool head_only = request_->method == api::Method::head;
    const bool streamed = static_cast<bool>(response.body_stream);
    if (context_->stopping || (streamed && http_1_0)) keep = false;
    // A handler that knows the length of its stream says it itself.
    const bool sized = std::ranges::any_of(
        response.headers, [](const auto& header) { return header.first == "Content-Length"; });
    const auto coding = !streamed           ? BodyCoding::length
                        : http_1_0 || sized ? BodyCoding::until_close
                                            : BodyCoding::chunked;
    const std::string head =
        response_head(response, request_->request_id, coding, response.body.size(), keep, http_1_0);
    const bool bodiless = head_only || response.status == 204 || response.status == 304;
    bool sent = false;
    if (bodiless || !streamed) {
      sent = co_await wire_.write(head, bodiless ? std::string_view{} : std::string_view{response.body});
    } else {
      sent = co_await wire_.write(head, {});
      if (sent) sent = co_await write_stream(response, coding == BodyCoding::chunked);
    }
    context_->gateway.answered(*request_, route_, response.status, seconds(), wire_.take_bytes_out());
    request_.reset();
    share_.reset();
    pool_ = &context_->pools.ordinary;
    if (!sent) co_return false;
    if (!keep) co_await wire_.say_goodbye();
    co_return keep;
  }

  awaitable<bool> write_stream(api::Response& response, bool chunked) {
    const auto source = std::make_shared<api::BodyWriter>(std::move(response.body_stream));
    for (;;) {
      const auto job = std::make_shared<Job>();
      const auto failed = std::make_shared<bool>(false);
      const auto pull = [job, failed, source, self = shared_from_this()] {
        const auto ran = guarded("answer", [&] { job->response.body = (*source)(); });
        *failed = !ran;  // too late for a status: the missing end tells the client
        asio::post(self->wire_.executor(), [job, self] {
          job->done = true;
          self->bell_.cancel();
        });
      };
      while (!pool_->try_submit(pull)) {
        if (context_->stopping) co_return false;
        bell_.expires_after(std::chrono::milliseconds(20));
        co_await bell_.async_wait(k_wait);
      }
      while (!job->done) co_await wait_for_bell();
      if (*failed) co_return false;
      std::string& piece = job->response.body;
      const bool last = piece.empty();
      if (chunked) {
        std::array<char, 24> size{};
        const int n = std::snprintf(size.data(), size.size(), "%zx\r\n", piece.size());
        piece.append("\r\n");
        const bool sent = co_await wire_.write({size.data(), static_cast<std::size_t>(n)}, piece);
        if (!sent) co_return false;
      } else if (!last) {
        const bool sent = co_await wire_.write(piece, {});
        if (!sent) co_return false;
      }
      if (last) co_return true;
    }
  }

  /// Answer of a framing error or an excess: then close, never read on.
  awaitable<void> refuse(Refusal refusal) {
    auto response = context_->gateway.problem(refusal.status, refusal.type, std::move(refusal.detail));
    for (auto& [name, value] : refusal.headers) response.header(std::move(name), std::move(value));
    api::Request none;
    const api::Request& request = request_ ? *request_ : none;
    const std::string id = request.request_id.empty() ? request_id_of({}) : request.request_id;
    const std::string head =
        response_head(response, id, BodyCoding::length, response.body.size(), false, false);
    const bool sent = co_await wire_.write(head, response.body);
    context_->gateway.answered(request, route_, refusal.status, seconds(), wire_.take_bytes_out());
    if (sent) co_await wire_.say_goodbye();
  }

  double seconds() const { return std::chrono::duration<double>(SteadyClock::now() - started_).count(); }

  HttpWire wire_;
  asio::steady_timer bell_;
  std::shared_ptr<SessionContext> context_;
  ConnectionSlot slot_;
  const HttpLimits& limits_;
  bool awaits_head_{false};
  const bool tls_;
  WorkerPool* pool_;             ///< of the exchange that runs
  std::shared_ptr<void> share_;  ///< of heavy work, while it runs and is sent
  const std::string peer_;       ///< who connected
  std::string remote_, route_;
  std::shared_ptr<api::Request> request_;  ///< of the exchange that runs
  Refusal refusal_;
  SteadyClock::time_point started_{};
};

}  // namespace

void start_http_session(tcp::socket socket, std::shared_ptr<SessionContext> context, ConnectionSlot slot,
                        bool tls) {
  const auto executor = socket.get_executor();
  auto session = std::make_shared<HttpSession>(std::move(socket), context, std::move(slot), tls);
  asio::co_spawn(executor, HttpSession::run(session),
                 [session](const std::exception_ptr& fault) { (void)guarded_end("connection", fault); });
}

}  // namespace anchord::server
