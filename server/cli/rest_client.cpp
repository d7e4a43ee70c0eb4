#include "server/cli/rest_client.hpp"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <thread>

#include "api/json/flight_requests.hpp"

// Last, and never before Eigen: it brings <resolv.h>, whose macro `_res` breaks Eigen's headers.
#include <httplib.h>

namespace anchord::cli {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr auto k_give_up_after = std::chrono::seconds(60);
constexpr auto k_first_pause = std::chrono::milliseconds(100);
constexpr auto k_longest_pause = std::chrono::milliseconds(5000);
constexpr auto k_look_every = std::chrono::milliseconds(50);

bool worth_another_try(int status) {
  return status == 408 || status == 429 || (status >= 500 && status != 507);
}

Errc errc_of(int status) {
  if (status == 404) return Errc::not_found;
  if (status == 409 || status == 412) return Errc::conflict;
  if (status == 507) return Errc::storage_full;
  return Errc::invalid_argument;
}

}  // namespace

struct RestClient::State {
  State(const std::string& origin, std::string prefix_path, std::function<bool()> cancelled_by)
      : client(origin), prefix(std::move(prefix_path)), cancelled(std::move(cancelled_by)), name(origin) {}
  httplib::Client client;
  std::string prefix;
  std::function<bool()> cancelled;
  std::string name;

  bool pause(std::chrono::milliseconds length) const {
    const auto until = SteadyClock::now() + length;
    while (SteadyClock::now() < until) {
      if (cancelled()) return false;
      std::this_thread::sleep_for(std::min<SteadyClock::duration>(k_look_every, until - SteadyClock::now()));
    }
    return true;
  }

  Result<std::string> until_answered(const std::string& what,
                                     const std::function<httplib::Result()>& send) const {
    const auto give_up = SteadyClock::now() + k_give_up_after;
    auto length = k_first_pause;
    for (;;) {
      if (cancelled()) return make_error(Errc::canceled, "stopped");
      const httplib::Result answer = send();
      if (answer && answer->status >= 200 && answer->status < 300) return answer->body;
      if (answer && !worth_another_try(answer->status)) {
        return make_error(errc_of(answer->status), what + ": " + std::to_string(answer->status) + " " +
                                                       api::problem_text(answer->body));
      }
      const std::string why = answer ? std::to_string(answer->status) + " " + api::problem_text(answer->body)
                                     : httplib::to_string(answer.error());
      if (SteadyClock::now() + length > give_up)
        return make_error(Errc::link_lost, name + " " + what + ": " + why);
      if (!pause(length)) return make_error(Errc::canceled, "stopped while " + name + " was away: " + why);
      length = std::min(length * 2, k_longest_pause);
    }
  }
};

Result<std::unique_ptr<RestClient>> RestClient::make(const std::string& url, const std::string& token,
                                                     std::function<bool()> cancelled) {
  const auto scheme = url.find("://");
  const std::string word = url.substr(0, scheme == std::string::npos ? 0 : scheme);
  if (word != "http" && word != "https") {
    return make_error(Errc::invalid_argument, "not a URL like http://127.0.0.1:8420: " + url);
  }
  const auto slash = url.find('/', scheme + 3);
  std::string prefix = slash == std::string::npos ? "" : url.substr(slash);
  while (!prefix.empty() && prefix.back() == '/') prefix.pop_back();
  auto state = std::make_unique<State>(url.substr(0, slash), std::move(prefix), std::move(cancelled));
  if (!state->client.is_valid()) return make_error(Errc::invalid_argument, "not a URL: " + url);
  state->client.set_keep_alive(true);
  state->client.set_tcp_nodelay(true);  // small requests one after the other would wait for each other's ACK
  state->client.set_connection_timeout(5);
  state->client.set_read_timeout(60);
  state->client.set_write_timeout(60);
  if (!token.empty()) state->client.set_default_headers({{"Authorization", "Bearer " + token}});
  return std::unique_ptr<RestClient>(new RestClient(std::move(state)));
}

RestClient::RestClient(std::unique_ptr<State> state) : state_(std::move(state)) {}
RestClient::~RestClient() = default;

Result<std::string> RestClient::get(const std::string& path) {
  return state_->until_answered("GET " + path,
                                [&] { return state_->client.Get((state_->prefix + path).c_str()); });
}

Result<std::string> RestClient::post(const std::string& path, const std::string& content_type,
                                     const std::string& body, const std::string& idempotency_key) {
  httplib::Headers headers;
  if (!idempotency_key.empty()) headers.emplace("Idempotency-Key", idempotency_key);
  return state_->until_answered("POST " + path, [&] {
    return state_->client.Post((state_->prefix + path).c_str(), headers, body, content_type.c_str());
  });
}

Result<std::string> read_token_file(const std::string& path) {
  if (path.empty()) return std::string{};
  std::ifstream in(path);
  std::string token;
  if (!(in >> token)) return make_error(Errc::invalid_argument, path + ": no access token in this file");
  return token;
}

}  // namespace anchord::cli
