#include "server/http/http_client.hpp"

#include <cstdlib>

#include "core/base/text.hpp"
#include "server/http/text.hpp"

// Last, and never before Eigen: it brings <resolv.h>, whose macro `_res` breaks Eigen's headers.
#include <httplib.h>

namespace anchord::server {
namespace {

std::string why(httplib::Error error, const std::string& origin) {
  switch (error) {
    case httplib::Error::Connection:
    case httplib::Error::ConnectionTimeout:
      return "cannot reach " + origin + ": is a server running there?";
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

}  // namespace

struct HttpClient::State {
  State(std::string at, std::string before)
      : origin(std::move(at)), prefix(std::move(before)), client(origin) {}
  std::string origin, prefix;
  httplib::Client client;
  httplib::Headers headers;
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
  auto state = std::make_unique<State>(std::string(url.substr(0, slash)), std::string(prefix));
  if (!state->client.is_valid()) return bad();
  if (word == "https" && !trusted_file().empty()) state->client.set_ca_cert_path(trusted_file().c_str());
  state->client.set_keep_alive(true);
  state->client.set_tcp_nodelay(true);  // small requests one after the other would wait for each other's ACK
  state->client.set_url_encode(false);
  state->client.set_connection_timeout(std::min<std::chrono::milliseconds>(timeout, std::chrono::seconds(5)));
  state->client.set_read_timeout(timeout);
  state->client.set_write_timeout(timeout);
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
  httplib::Request request;
  request.method = method;
  request.path = state_->prefix + std::string(target);
  request.headers = state_->headers;
  for (const auto& [name, value] : headers) request.headers.emplace(name, value);
  if (!body.empty()) {
    request.headers.emplace("Content-Type", content_type);
    request.body = body;
  }
  const auto answer = state_->client.send(request);
  if (!answer) return make_error(Errc::link_lost, why(answer.error(), state_->origin));
  ClientResponse response;
  response.status = answer->status;
  for (const auto& [name, value] : answer->headers) response.headers[lower(name)] = value;
  response.body = answer->body;
  return response;
}

}  // namespace anchord::server
