#include <array>
#include <optional>
#include <string>
#include <utility>

#include "server/http/body_pipe.hpp"
#include "server/http/rate_floor.hpp"
#include "server/http/request_id.hpp"
#include "server/http/request_judge.hpp"
#include "server/http/request_parser.hpp"
#include "server/http/response_writer.hpp"
#include "server/http/sessions.hpp"
#include "server/runtime/worker_pool.hpp"

namespace anchord::server {
namespace {

using SteadyClock = std::chrono::steady_clock;
template <class T>
using awaitable = asio::awaitable<T>;

constexpr std::size_t k_head_read_bytes = 4096;
constexpr std::size_t k_piece_bytes = 16 * 1024;

enum class BodyEnd : std::uint8_t { complete, lost, refused };

/// One HTTP connection. Everything runs on the strand of its socket; handlers run on the pools and ring
/// `bell_`.
class HttpSession final : public Connection, public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(tcp::socket socket, std::shared_ptr<SessionContext> context, ConnectionSlot slot)
      : stream_(std::move(socket)),
        bell_(stream_.get_executor()),
        context_(std::move(context)),
        slot_(std::move(slot)),
        limits_(context_->limits) {
    error_code ignored;
    const auto peer = stream_.socket().remote_endpoint(ignored);
    remote_ = peer.address().to_string(ignored);
  }
  ~HttpSession() override { context_->leave(this); }

  static awaitable<void> run(std::shared_ptr<HttpSession> self) {
    self->context_->enter(self.get(), self->weak_from_this());
    bool first = true;
    while (co_await self->serve_one(first)) first = false;
  }

  void stop() override {
    asio::post(stream_.get_executor(), [self = shared_from_this()] {
      if (self->idle_) self->close();
    });
  }
  void abort() override {
    asio::post(stream_.get_executor(), [self = shared_from_this()] { self->close(); });
  }

 private:
  std::string_view buffered() const {
    const auto bytes = buffer_.cdata();
    return {static_cast<const char*>(bytes.data()), bytes.size()};
  }
  void close() {
    error_code ignored;
    stream_.socket().close(ignored);
    bell_.cancel();
  }

  /// One request and its answer. False: the connection is finished.
  awaitable<bool> serve_one(bool first) {
    const std::optional<std::size_t> head_end = co_await read_head(first);
    if (!head_end) co_return false;
    started_ = SteadyClock::now();
    RequestParser parser(limits_);
    auto broken = parser.parse_head(buffered().substr(0, *head_end));
    Judgement judgement;
    if (broken) {
      judgement = std::move(*broken);
    } else {
      judgement = judge_head(parser.head(), limits_, context_->hosts);
    }
    buffer_.consume(*head_end);
    if (auto* refusal = std::get_if<Refusal>(&judgement)) {
      co_await refuse(*refusal);
      co_return false;
    }
    auto& judged = std::get<JudgedHead>(judgement);
    request_ = std::make_shared<api::Request>(std::move(judged.request));
    request_->request_id = request_id_of(request_->header("x-request-id"));
    request_->remote = remote_;
    Admission admission = context_->gateway.admit(*request_, judged.host, judged.websocket);
    route_ = admission.route;
    if (admission.websocket && !admission.refusal) {
      if (buffer_.size() != 0) {
        const Refusal early{400, "malformed", "data before the WebSocket handshake was answered"};
        co_await refuse(early);
        co_return false;
      }
      auto peer = admission.websocket();
      stream_.expires_never();
      context_->gateway.answered(*request_, route_, 101, seconds(), 0);
      start_ws_session(std::move(stream_), context_, std::move(slot_), *request_, admission.subprotocol,
                       std::move(peer));
      co_return false;
    }
    co_return co_await exchange(parser, judged, admission);
  }

  /// Bytes of one head in the buffer: its size, or null when the connection has ended.
  awaitable<std::optional<std::size_t>> read_head(bool first) {
    HeadScan scan;
    if (buffer_.size() == 0) buffer_.shrink_to_fit();  // an idle connection holds no buffer
    bool started = buffer_.size() != 0;
    auto deadline = SteadyClock::now() + (first || started ? limits_.head_time : limits_.keep_alive);
    for (;;) {
      // RFC 9112 section 2.2: an empty line before the request line is a habit of old clients.
      while (scan.scanned == 0 && buffered().starts_with("\r\n")) buffer_.consume(2);
      if (const auto bytes = buffered(); !bytes.empty() && !(bytes == "\r" && scan.scanned == 0)) {
        auto seen = scan_head(bytes, scan, limits_);
        if (auto* refusal = std::get_if<Refusal>(&seen)) {
          started_ = SteadyClock::now();
          co_await refuse(*refusal);
          co_return std::nullopt;
        }
        scan = std::get<HeadScan>(seen);
        if (scan.head_end != 0) co_return scan.head_end;
      }
      if (!started && context_->stopping) co_return std::nullopt;
      idle_ = !started;
      stream_.expires_at(deadline);
      const auto space = buffer_.prepare(k_head_read_bytes);
      const auto [error, n] = co_await stream_.async_read_some(space, k_wait);
      idle_ = false;
      if (error) co_return std::nullopt;
      buffer_.commit(n);
      if (!started) {
        started = true;
        deadline = SteadyClock::now() + limits_.head_time;
      }
    }
  }

  awaitable<bool> exchange(RequestParser& parser, JudgedHead& judged, Admission& admission) {
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
      if (judged.expects_continue && buffer_.size() == 0) {
        const std::string go_on = "HTTP/1.1 100 Continue\r\n\r\n";
        const bool sent = co_await write_all(go_on, {});
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

  /// The next decoded piece: false when nothing more will come (see `end`).
  awaitable<bool> next_piece(RequestParser& parser, RateFloor& floor, std::span<char> out,
                             std::size_t& produced, BodyEnd& end) {
    for (;;) {
      const auto step = parser.decode(buffered(), out);
      buffer_.consume(step.consumed);
      if (step.refusal) {
        refusal_ = *step.refusal;
        end = BodyEnd::refused;
        co_return false;
      }
      produced = step.produced;
      if (step.produced > 0 || step.done) co_return true;
      stream_.expires_at(floor.deadline());
      const auto space =
          buffer_.prepare(std::max<std::size_t>(limits_.read_buffer_bytes - buffer_.size(), 4096));
      const auto [error, n] = co_await stream_.async_read_some(space, k_wait);
      if (error) {
        end = BodyEnd::lost;
        co_return false;
      }
      floor.received(SteadyClock::now(), n);
      buffer_.commit(n);
    }
  }

  awaitable<BodyEnd> read_body(RequestParser& parser, const JudgedHead& judged, std::uint64_t limit,
                               std::string& body) {
    if (parser.done()) co_return BodyEnd::complete;
    buffer_.reserve(limits_.read_buffer_bytes);
    RateFloor floor(SteadyClock::now(), limits_.body_window, limits_.body_floor_bytes_per_s);
    BodyEnd end = BodyEnd::complete;
    if (judged.framing == Framing::length)
      body.reserve(std::min<std::uint64_t>(judged.content_length, 1u << 20));
    while (!parser.done()) {
      const std::size_t at = body.size();
      body.resize(at + k_piece_bytes);
      std::size_t produced = 0;
      const bool more = co_await next_piece(parser, floor, {body.data() + at, k_piece_bytes}, produced, end);
      body.resize(at + produced);
      if (!more) co_return end;
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
    buffer_.reserve(limits_.read_buffer_bytes);
    RateFloor floor(SteadyClock::now(), limits_.body_window, limits_.body_floor_bytes_per_s);
    std::string piece(k_piece_bytes, '\0');
    std::shared_ptr<Job> job;
    BodyEnd end = BodyEnd::complete;
    std::uint64_t total = 0;
    while (!parser.done() && !pipe->abandoned()) {
      const std::size_t space = pipe->space();
      if (space == 0) {
        if (!job) job = submit(context_->stream_pool, admission.run, pipe);
        if (!job) break;
        const auto before = SteadyClock::now();
        while (pipe->space() == 0 && !job->done) co_await wait_for_bell();
        floor.waited(SteadyClock::now() - before);
        continue;
      }
      std::size_t produced = 0;
      const bool more =
          co_await next_piece(parser, floor, {piece.data(), std::min(space, piece.size())}, produced, end);
      if (!more) {
        if (end == BodyEnd::lost) {
          pipe->fail(400, "the connection ended, or fell below 1 KiB/s, inside the body");
        } else {
          pipe->fail(refusal_.status, refusal_.detail);
        }
        break;
      }
      total += produced;
      if (total > admission.body_limit) {
        refusal_ =
            Refusal{413, "too-large",
                    "the body may have at most " + std::to_string(admission.body_limit) + " bytes here"};
        pipe->fail(413, refusal_.detail);
        end = BodyEnd::refused;
        break;
      }
      pipe->feed({piece.data(), produced});
    }
    if (parser.done()) pipe->finish();
    if (end == BodyEnd::complete && !job && parser.done())
      job = submit(context_->stream_pool, admission.run, pipe);
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
          job->response = self->guarded(run, *request);
          if (pipe) pipe->abandon();
          gzip_response(job->response, request->header("accept-encoding"), from);
          asio::post(self->stream_.get_executor(), [job, self] {
            job->done = true;
            self->bell_.cancel();
          });
        });
    return taken ? job : nullptr;
  }

  api::Response guarded(const std::function<api::Response(api::Request&)>& run, api::Request& request) {
    try {
      return run(request);
    } catch (const std::exception& fault) {
      if (context_->log_fault) context_->log_fault(fault.what());
      return context_->gateway.problem(500, "internal", "");
    }
  }

  api::Response overloaded() {
    auto response = context_->gateway.problem(503, "overloaded", "too many requests wait");
    response.header("Retry-After", "1");
    return response;
  }

  awaitable<void> run_handler(Admission& admission, api::Response& response) {
    if (admission.quick) {
      response = guarded(admission.run, *request_);
      gzip_response(response, request_->header("accept-encoding"), limits_.gzip_from_bytes);
      co_return;
    }
    const auto job = submit(context_->pool, admission.run, nullptr);
    if (!job) {
      response = overloaded();
      co_return;
    }
    while (!job->done) co_await wait_for_bell();
    response = std::move(job->response);
  }

  void ring() {
    asio::post(stream_.get_executor(), [self = shared_from_this()] { self->bell_.cancel(); });
  }
  awaitable<void> wait_for_bell() {
    bell_.expires_at(SteadyClock::time_point::max());
    co_await bell_.async_wait(k_wait);
  }

  /// Writes both, in order; false when the peer is gone or makes no progress.
  awaitable<bool> write_all(std::string_view a, std::string_view b) {
    while (!a.empty() || !b.empty()) {
      const std::array<asio::const_buffer, 2> buffers{asio::buffer(a.data(), a.size()),
                                                      asio::buffer(b.data(), b.size())};
      stream_.expires_after(limits_.write_stall);
      const auto [error, n] = co_await stream_.async_write_some(buffers, k_wait);
      if (error) co_return false;
      bytes_out_ += n;
      const std::size_t of_a = std::min(n, a.size());
      a.remove_prefix(of_a);
      b.remove_prefix(n - of_a);
    }
    co_return true;
  }

  awaitable<bool> answer(api::Response& response, const JudgedHead& judged, bool keep) {
    const bool http_1_0 = judged.version == 10;
    const bool head_only = request_->method == api::Method::head;
    const bool streamed = static_cast<bool>(response.body_stream);
    if (context_->stopping || (streamed && http_1_0)) keep = false;
    const auto coding = !streamed  ? BodyCoding::length
                        : http_1_0 ? BodyCoding::until_close
                                   : BodyCoding::chunked;
    const std::string head =
        response_head(response, request_->request_id, coding, response.body.size(), keep, http_1_0);
    const bool bodiless = head_only || response.status == 204 || response.status == 304;
    bool sent = false;
    if (bodiless || !streamed) {
      sent = co_await write_all(head, bodiless ? std::string_view{} : std::string_view{response.body});
    } else {
      sent = co_await write_all(head, {});
      if (sent) sent = co_await write_stream(response, coding == BodyCoding::chunked);
    }
    context_->gateway.answered(*request_, route_, response.status, seconds(), bytes_out_);
    bytes_out_ = 0;
    request_.reset();
    if (!sent) co_return false;
    if (!keep) co_await say_goodbye();
    co_return keep;
  }

  awaitable<bool> write_stream(api::Response& response, bool chunked) {
    const auto source = std::make_shared<api::BodyWriter>(std::move(response.body_stream));
    for (;;) {
      const auto job = std::make_shared<Job>();
      const auto failed = std::make_shared<bool>(false);
      const auto pull = [job, failed, source, self = shared_from_this()] {
        try {
          job->response.body = (*source)();
        } catch (const std::exception& fault) {
          *failed = true;  // too late for a status: the missing end tells the client
          if (self->context_->log_fault) self->context_->log_fault(fault.what());
        }
        asio::post(self->stream_.get_executor(), [job, self] {
          job->done = true;
          self->bell_.cancel();
        });
      };
      while (!context_->pool.try_submit(pull)) {
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
        const bool sent = co_await write_all({size.data(), static_cast<std::size_t>(n)}, piece);
        if (!sent) co_return false;
      } else if (!last) {
        const bool sent = co_await write_all(piece, {});
        if (!sent) co_return false;
      }
      if (last) co_return true;
    }
  }

  /// Answer of a framing error or an excess: then close, never read on.
  awaitable<void> refuse(Refusal refusal) {
    auto response = context_->gateway.problem(refusal.status, refusal.type, std::move(refusal.detail));
    api::Request none;
    const api::Request& request = request_ ? *request_ : none;
    const std::string id = request.request_id.empty() ? request_id_of({}) : request.request_id;
    const std::string head =
        response_head(response, id, BodyCoding::length, response.body.size(), false, false);
    const bool sent = co_await write_all(head, response.body);
    context_->gateway.answered(request, route_, refusal.status, seconds(), bytes_out_);
    if (sent) co_await say_goodbye();
  }

  /// Half-closes and throws away what the peer still sends, for a moment: closing with unread bytes would
  /// reset the connection and take the answer with it.
  awaitable<void> say_goodbye() {
    error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    if (ignored) co_return;
    const auto deadline = SteadyClock::now() + limits_.linger;
    buffer_.clear();
    for (std::size_t thrown = 0; thrown < 16 * limits_.drain_bytes;) {
      stream_.expires_at(deadline);
      const auto space = buffer_.prepare(k_head_read_bytes);
      const auto [error, n] = co_await stream_.async_read_some(space, k_wait);
      if (error) break;
      thrown += n;
    }
    stream_.socket().close(ignored);
  }

  double seconds() const { return std::chrono::duration<double>(SteadyClock::now() - started_).count(); }

  beast::tcp_stream stream_;
  asio::steady_timer bell_;
  beast::flat_buffer buffer_;
  std::shared_ptr<SessionContext> context_;
  ConnectionSlot slot_;
  const HttpLimits& limits_;
  std::string remote_, route_;
  std::shared_ptr<api::Request> request_;  ///< of the exchange that runs
  Refusal refusal_;
  SteadyClock::time_point started_{};
  std::size_t bytes_out_{0};
  bool idle_{false};
};

}  // namespace

void start_http_session(tcp::socket socket, std::shared_ptr<SessionContext> context, ConnectionSlot slot) {
  const auto executor = socket.get_executor();
  auto session = std::make_shared<HttpSession>(std::move(socket), context, std::move(slot));
  asio::co_spawn(executor, HttpSession::run(session), [context, session](const std::exception_ptr& fault) {
    if (!fault) return;
    try {
      std::rethrow_exception(fault);
    } catch (const std::exception& what) {
      if (context->log_fault) context->log_fault(what.what());
    }
  });
}

}  // namespace anchord::server
