#include "server/http/web_post.hpp"

#include <netdb.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <optional>
#include <set>

#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "server/http/answer_watch.hpp"
#include "server/http/public_address.hpp"

// Last, and never before Eigen: it brings <resolv.h>, whose macro `_res` breaks Eigen's headers.
#include <httplib.h>

namespace anchord::server {
namespace {

using Steady = std::chrono::steady_clock;
constexpr auto k_whole = std::chrono::seconds(20);  ///< of one exchange
constexpr auto k_step = std::chrono::seconds(5);    ///< of one connect, read or write

/// The library has one word for each, which says little to who reads why a delivery failed.
const char* in_words(httplib::Error error) {
  switch (error) {
    case httplib::Error::Connection:
      return "no connection: refused, or no way there";
    case httplib::Error::ConnectionTimeout:
      return "no connection within 5 s";
    case httplib::Error::Read:
      return "connected, and then no answer within 5 s, or the connection was closed";
    case httplib::Error::Write:
      return "the connection was closed before all was sent";
    case httplib::Error::SSLConnection:
      return "no TLS connection: does TLS run there?";
    case httplib::Error::SSLLoadingCerts:
      return "no TLS connection: the certificates of this machine cannot be read";
    case httplib::Error::SSLServerVerification:
      return "its certificate is for another name, or of no authority that this machine trusts";
    default:
      return "the exchange failed";
  }
}

struct Url {
  bool tls{};
  std::string host, path;
  int port{};
};

std::optional<Url> parse(const std::string& text) {
  Url out;
  std::string_view rest = text;
  if (rest.starts_with("https://"))
    out.tls = true;
  else if (!rest.starts_with("http://"))
    return std::nullopt;
  rest.remove_prefix(out.tls ? 8 : 7);
  for (const char c : text) {
    if (static_cast<unsigned char>(c) <= ' ' || static_cast<unsigned char>(c) >= 0x7f) return std::nullopt;
  }
  const auto end = rest.find_first_of("/?#");
  auto authority = rest.substr(0, end);
  out.path = end == std::string_view::npos ? "/" : std::string(rest.substr(end));
  if (out.path.find('#') != std::string::npos || authority.find('@') != std::string_view::npos)
    return std::nullopt;
  if (!out.path.starts_with('/')) out.path.insert(0, "/");
  out.port = out.tls ? 443 : 80;
  const auto bracket = authority.rfind(']');
  const auto colon = authority.rfind(':');
  if (colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket)) {
    const auto digits = authority.substr(colon + 1);
    int port = 0;
    for (const char c : digits) {
      if (c < '0' || c > '9' || port > 65535) return std::nullopt;
      port = port * 10 + (c - '0');
    }
    if (digits.empty() || port < 1 || port > 65535) return std::nullopt;
    out.port = port;
    authority = authority.substr(0, colon);
  }
  if (authority.starts_with('[') && authority.ends_with(']'))
    authority = authority.substr(1, authority.size() - 2);
  if (authority.empty()) return std::nullopt;
  out.host = std::string(authority);
  return out;
}

/// Every address of the name, numeric, in the order of the resolver.
std::vector<std::string> resolved(const Url& url) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_ADDRCONFIG;
  addrinfo* first = nullptr;
  if (getaddrinfo(url.host.c_str(), nullptr, &hints, &first) != 0) return {};
  std::vector<std::string> out;
  for (const addrinfo* at = first; at != nullptr; at = at->ai_next) {
    char text[NI_MAXHOST];
    if (getnameinfo(at->ai_addr, at->ai_addrlen, text, sizeof text, nullptr, 0, NI_NUMERICHOST) == 0)
      out.emplace_back(text);
  }
  freeaddrinfo(first);
  return out;
}

class HttpPost final : public WebPost {
 public:
  HttpPost(bool allow_private, std::string ca_file)
      : allow_private_(allow_private), ca_file_(std::move(ca_file)) {}

  Result<void> check(const std::string& url) const override {
    if (parse(url)) return boost::outcome_v2::success();
    return make_error(Errc::invalid_argument,
                      "'" + to_utf8(url, 120) + "' is not like https://host/path, without user and fragment");
  }

  Result<Answer> send(const Message& message) override {
    BOOST_OUTCOME_TRY(check(message.url));
    const Url url = *parse(message.url);
    const auto addresses = resolved(url);
    if (addresses.empty()) return make_error(Errc::link_lost, url.host + " has no address");
    std::string pinned;
    for (const auto& one : addresses) {
      if (!allow_private_ && !is_public_address(one))
        return make_error(Errc::invalid_argument, url.host + " is " + one +
                                                      ", an address of this machine or of a private network: "
                                                      "to allow it, set webhooks.allow_private");
      if (pinned.empty()) pinned = one;
    }
    return exchange(url, pinned, message);
  }

  void stop() override {
    auto state = running_.lock();
    state->stopped = true;
    for (auto* client : state->clients) client->stop();
  }

 private:
  struct Running {
    bool stopped{false};
    std::set<httplib::Client*> clients;
  };

  Result<Answer> exchange(const Url& url, const std::string& pinned, const Message& message) {
    const bool v6 = url.host.find(':') != std::string::npos;
    httplib::Client client((url.tls ? "https://" : "http://") + (v6 ? '[' + url.host + ']' : url.host) + ':' +
                           std::to_string(url.port));
    if (!client.is_valid())
      return make_error(Errc::invalid_argument, "'" + to_utf8(message.url, 120) + "' cannot be used");
    // What was checked is what is connected to; a second look-up may answer otherwise.
    client.set_hostname_addr_map({{url.host, pinned}});
    client.set_follow_location(false);
    client.set_keep_alive(false);
    if (!ca_file_.empty()) client.set_ca_cert_path(ca_file_.c_str());
    client.set_url_encode(false);
    client.set_connection_timeout(k_step);
    client.set_read_timeout(k_step);
    client.set_write_timeout(k_step);
    std::atomic<int> socket{-1};
    client.set_socket_options([&socket](int opened) {
      httplib::default_socket_options(opened);
      socket = opened;
    });
    if (!enter(&client)) return make_error(Errc::canceled, "the server is stopping");
    // A receiver is a stranger: its head may come a drop at a time, or never end.
    AnswerWatch watch(socket, {k_whole, [&client] { client.stop(); }});
    const auto end = Steady::now() + k_whole;
    Answer answer;
    httplib::Request request;
    request.method = message.method;
    request.path = url.path;
    request.body = message.body;
    for (const auto& [name, value] : message.headers) request.headers.emplace(name, value);
    request.response_handler = [&](const httplib::Response& head) {
      watch.begun();
      answer.status = head.status;
      return true;
    };
    request.content_receiver = [&](const char* bytes, std::size_t n, std::uint64_t, std::uint64_t) {
      watch.received(n);
      answer.body.append(bytes, std::min(n, k_most_answer - answer.body.size()));
      return answer.body.size() < k_most_answer && Steady::now() < end;
    };
    const auto result = client.send(request);
    const bool stopped = leave(&client);
    // The head of an answer without a body is not handed on before.
    if (result) answer.status = result->status;
    if (answer.status != 0) return answer;  // perhaps its body was cut off
    if (stopped) return make_error(Errc::canceled, "the server is stopping");
    if (const auto why = watch.why(); !why.empty()) return make_error(Errc::link_lost, url.host + " " + why);
    return make_error(Errc::link_lost,
                      "no answer from " + url.host + " (" + pinned + "): " + in_words(result.error()));
  }

  bool enter(httplib::Client* client) {
    auto state = running_.lock();
    if (state->stopped) return false;
    state->clients.insert(client);
    return true;
  }
  bool leave(httplib::Client* client) {
    auto state = running_.lock();
    state->clients.erase(client);
    return state->stopped;
  }

  const bool allow_private_;
  const std::string ca_file_;
  Locked<Running> running_;
};

}  // namespace

std::unique_ptr<WebPost> make_web_post(bool allow_private, std::string ca_file) {
  return std::make_unique<HttpPost>(allow_private, std::move(ca_file));
}

}  // namespace anchord::server
