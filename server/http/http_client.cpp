#include "server/http/http_client.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>

#include "core/base/text.hpp"
#include "server/http/answer_watch.hpp"
#include "server/http/text.hpp"

// Last, and never before Eigen: it brings <resolv.h>, whose macro `_res` breaks Eigen's headers.
#include <httplib.h>

namespace anchord::server {
namespace {

/// Digits, or in brackets: nothing that is looked up.
bool is_address(std::string_view origin) {
  const auto host = origin.substr(origin.find("://") + 3);
  return host.starts_with('[') || host.find_first_not_of("0123456789.:") == std::string_view::npos;
}

std::string why(httplib::Error error, const std::string& origin) {
  switch (error) {
    case httplib::Error::Connection:
    case httplib::Error::ConnectionTimeout:
      return "cannot reach " + origin + (is_address(origin) ? ": is" : ": is the name right, and is") +
             " a server running there?";
    case httplib::Error::Read:
      return origin + " did not answer in time, or closed the connection";
    case httplib::Error::Write:
      return origin + " closed the connection during the request";
    case httplib::Error::SSLConnection:
    case httplib::Error::SSLLoadingCerts:
    case httplib::Error::SSLServerVerification:
      return origin +
             ": no TLS connection: does TLS run there, with a certificate for this name that is trusted "
             "here? "
             "ANCHORD_CA_FILE names the authority (ca.pem of anchord tls init)";
    default:
      return origin + ": " + httplib::to_string(error);
  }
}

std::string& trusted_file() {
  static std::string file = [] {
    const char* given = std::getenv("ANCHORD_CA_FILE");
    return std::string(given == nullptr ? "" : given);
  }();
  return file;
}

/// A link that acknowledges nothing for so long is dead; the system would try for a quarter of an hour.
constexpr unsigned k_dead_link_ms = 60'000;
constexpr std::size_t k_sent_bytes = std::size_t{16} << 10;

/// What comes of a call, piece by piece.
class Exchange {
 public:
  Exchange(const ClientRequest& request, AnswerWatch* watch) : request_(request), watch_(watch) {}

  /// A body is handed on in pieces, so that the time that it takes does not count as the answer's.
  void send_with(httplib::Request& out) {
    if (request_.from != nullptr) {
      std::fseek(request_.from, 0, SEEK_END);
      const auto end = static_cast<std::size_t>(std::max(0L, std::ftell(request_.from)));
      out.content_length_ = static_cast<std::size_t>(
          request_.from_bytes.value_or(end - std::min<std::size_t>(end, request_.from_at)));
    } else {
      out.content_length_ = request_.body.size();
    }
    if (out.content_length_ == 0) return;
    out.headers.emplace("Content-Type", request_.content_type);
    out.content_provider_ = [this](std::size_t at, std::size_t left, httplib::DataSink& sink) {
      return piece(at, std::min(left, k_sent_bytes), sink);
    };
  }

  void receive_with(httplib::Request& out) {
    out.response_handler = [this](const httplib::Response& answer) {
      if (watch_ != nullptr) watch_->begun();
      take_head(answer);
      begin_file();
      bodiless_ = answer.status == 304;  // the library would wait for a body until the end of the connection
      return !bodiless_ && !failure_;
    };
    out.content_receiver = [this](const char* data, std::size_t n, std::uint64_t, std::uint64_t) {
      if (watch_ != nullptr) watch_->received(n);
      bytes_ += n;
      if (request_.most_bytes && bytes_ > *request_.most_bytes) {
        failure_ =
            make_error(Errc::bad_frame, "the answer is longer than the " +
                                            std::to_string(*request_.most_bytes) + " bytes it may have");
      } else if (into_ == nullptr) {
        response_.body.append(data, n);
      } else if (std::fwrite(data, 1, n, into_) != n) {
        failed();
      }
      return !failure_;
    };
  }

  /// Also of an answer that has no body (204, or to HEAD), for which the library calls nothing.
  void take_head(const httplib::Response& answer) {
    response_.status = answer.status;
    response_.headers.clear();
    for (const auto& [name, value] : answer.headers) response_.headers[lower(name)] = value;
    response_.body.clear();
  }
  bool has_head() const { return response_.status != 0; }
  bool bodiless() const { return bodiless_; }
  /// Of this side.
  std::optional<Error> failure() {
    if (!failure_ && into_ != nullptr && std::fflush(into_) != 0) failed();
    return failure_;
  }
  ClientResponse response() && { return std::move(response_); }

 private:
  void begin_file() {
    const bool part = response_.status == 206 && request_.into_at > 0;
    into_ = response_.status == 200 || part ? request_.into : nullptr;
    if (into_ == nullptr) return;
    if (request_.accepts)
      if (auto accepted = request_.accepts(response_); !accepted) {
        failure_ = accepted.error();
        return;
      }
    if (part &&
        !response_.headers["content-range"].starts_with("bytes " + std::to_string(request_.into_at) + '-')) {
      failure_ = make_error(Errc::bad_frame, "the answer is another part than was asked for");
      return;
    }
    const auto at = static_cast<long>(part ? request_.into_at : 0);
    if (std::fflush(into_) != 0 || ::ftruncate(::fileno(into_), at) != 0 ||
        std::fseek(into_, at, SEEK_SET) != 0)
      return failed();
    if (!request_.begins) return;
    if (auto begun = request_.begins(response_); !begun) failure_ = begun.error();
  }
  bool piece(std::size_t at, std::size_t n, httplib::DataSink& sink) {
    if (request_.from == nullptr) {
      (void)sink.write(request_.body.data() + at, n);
    } else {
      char buffer[k_sent_bytes];
      if (std::fseek(request_.from, static_cast<long>(request_.from_at + at), SEEK_SET) != 0 ||
          std::fread(buffer, 1, n, request_.from) != n)
        failed();
      if (!failure_) (void)sink.write(buffer, n);
    }
    if (watch_ != nullptr) watch_->sent();
    return !failure_;  // that the link is gone is the library's to say
  }
  void failed() {
    const bool full = errno == ENOSPC || errno == EDQUOT;
    failure_ = make_error(full ? Errc::storage_full : Errc::storage_unavailable,
                          full ? "the disk is full" : "cannot read or write a temporary file");
  }

  const ClientRequest& request_;
  AnswerWatch* const watch_;
  ClientResponse response_;
  std::FILE* into_{nullptr};
  std::uint64_t bytes_{};
  bool bodiless_{false};
  std::optional<Error> failure_;
};

}  // namespace

struct HttpClient::State {
  State(std::string at, std::string before, std::chrono::milliseconds most)
      : origin(std::move(at)), prefix(std::move(before)), timeout(most), client(origin) {}
  std::string origin, prefix;
  std::chrono::milliseconds timeout;
  httplib::Client client;
  httplib::Headers headers;
  std::atomic<int> socket{-1};
};

Result<HttpClient> HttpClient::to(std::string_view url, std::chrono::milliseconds timeout) {
  const auto scheme = url.find("://");
  const auto word = url.substr(0, scheme == std::string_view::npos ? 0 : scheme);
  const auto bad = [&] {
    return make_error(Errc::invalid_argument, "'" + to_utf8(url, 80) + "' is not like http://127.0.0.1:8420");
  };
  if (word != "http" && word != "https") return bad();
  const auto slash = url.find('/', scheme + 3);
  auto prefix = slash == std::string_view::npos ? std::string_view() : url.substr(slash);
  while (prefix.ends_with('/')) prefix.remove_suffix(1);
  auto state = std::make_unique<State>(std::string(url.substr(0, slash)), std::string(prefix), timeout);
  if (!state->client.is_valid()) return bad();
  if (word == "https" && !trusted_file().empty()) state->client.set_ca_cert_path(trusted_file().c_str());
  state->client.set_keep_alive(true);
  state->client.set_tcp_nodelay(true);  // small requests one after the other would wait for each other's ACK
  state->client.set_url_encode(false);
  state->client.set_connection_timeout(std::min<std::chrono::milliseconds>(timeout, std::chrono::seconds(5)));
  state->client.set_read_timeout(timeout);
  state->client.set_write_timeout(timeout);
  state->client.set_socket_options([state = state.get()](int socket) {
    httplib::default_socket_options(socket);
    (void)::setsockopt(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, &k_dead_link_ms, sizeof k_dead_link_ms);
    state->socket = socket;
  });
  return HttpClient(std::move(state));
}

void HttpClient::trust(const std::string& ca_file) { trusted_file() = ca_file; }

HttpClient::HttpClient(std::unique_ptr<State> state) : state_(std::move(state)) {}
HttpClient::HttpClient(HttpClient&& other) noexcept = default;
HttpClient::~HttpClient() = default;

void HttpClient::set_header(const std::string& name, const std::string& value) {
  state_->headers.emplace(name, value);
}

Result<ClientResponse> HttpClient::call(std::string_view method, std::string_view target,
                                        std::string_view body, std::string_view content_type,
                                        const std::map<std::string, std::string>& headers) {
  return call(
      {.method = method, .target = target, .body = body, .content_type = content_type, .headers = headers});
}

Result<ClientResponse> HttpClient::call(const ClientRequest& request) {
  httplib::Request out;
  out.method = request.method;
  out.path = state_->prefix + std::string(request.target);
  out.headers = state_->headers;
  for (const auto& [name, value] : request.headers) out.headers.emplace(name, value);
  std::optional<AnswerWatch> watch;
  if (request.most_bytes)
    watch.emplace(state_->socket,
                  AnswerWatch::Limits{state_->timeout, [client = &state_->client] { client->stop(); }});
  Exchange exchange(request, watch ? &*watch : nullptr);
  exchange.send_with(out);
  exchange.receive_with(out);
  const auto answer = state_->client.send(out);
  if (auto failure = exchange.failure()) {
    failure->message = state_->origin + ": " + failure->message;
    return *std::move(failure);
  }
  if (watch && !watch->why().empty()) return make_error(Errc::link_lost, state_->origin + " " + watch->why());
  if (!answer && !exchange.bodiless())
    return make_error(Errc::link_lost, why(answer.error(), state_->origin));
  if (answer && !exchange.has_head()) exchange.take_head(*answer);
  return std::move(exchange).response();
}

}  // namespace anchord::server
