#include "server/cli/rest_client.hpp"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <thread>

#include "api/measurements/flight_requests.hpp"
#include "server/http/http_client.hpp"
#include "server/runtime/token_file.hpp"

namespace anchord::cli {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr auto k_give_up_after = std::chrono::seconds(60);
constexpr auto k_never_answered = std::chrono::seconds(2);  ///< more likely a wrong address than a restart
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
  server::HttpClient client;
  std::string name;
  std::function<bool()> cancelled;
  bool answered{false};

  bool pause(std::chrono::milliseconds length) const {
    const auto until = SteadyClock::now() + length;
    while (SteadyClock::now() < until) {
      if (cancelled()) return false;
      std::this_thread::sleep_for(std::min<SteadyClock::duration>(k_look_every, until - SteadyClock::now()));
    }
    return true;
  }

  Result<std::string> until_answered(const std::string& method, const std::string& path,
                                     const std::string& body = {}, const std::string& content_type = {},
                                     const std::map<std::string, std::string>& headers = {}) {
    const std::string what = method + " " + path;
    const auto began = SteadyClock::now();
    auto length = k_first_pause;
    for (;;) {
      if (cancelled()) return make_error(Errc::canceled, "stopped");
      const auto answer = client.call(method, path, body, content_type, headers);
      answered = answered || answer;
      if (answer && answer.value().status >= 200 && answer.value().status < 300) return answer.value().body;
      // Not one row was taken: the report of that is an answer like any other, and the next rows may be good.
      if (answer && answer.value().status == 422 && api::parse_ingest_answer(answer.value().body))
        return answer.value().body;
      std::string why =
          answer ? std::to_string(answer.value().status) + " " + api::problem_text(answer.value().body)
                 : answer.error().message;
      if (answer && answer.value().status == 401)
        why += "; give a file with an access token with --token-file, or the token in ANCHORD_TOKEN";
      if (answer && !worth_another_try(answer.value().status))
        return make_error(errc_of(answer.value().status), what + ": " + why);
      if (!answered && SteadyClock::now() + length > began + k_never_answered)
        return make_error(Errc::link_lost, "no anchord server answers at " + name + ": " + why +
                                               " ('anchord doctor' looks). Give another address with --url");
      if (SteadyClock::now() + length > began + k_give_up_after)
        return make_error(Errc::link_lost, name + " " + what + ": " + why);
      if (!pause(length)) return make_error(Errc::canceled, "stopped while " + name + " was away: " + why);
      length = std::min(length * 2, k_longest_pause);
    }
  }
};

Result<std::unique_ptr<RestClient>> RestClient::make(const std::string& url, const std::string& token,
                                                     std::function<bool()> cancelled) {
  BOOST_OUTCOME_TRY(auto client, server::HttpClient::to(url, std::chrono::seconds(60)));
  if (!token.empty()) client.set_header("Authorization", "Bearer " + token);
  auto state = std::make_unique<State>(State{std::move(client), url, std::move(cancelled)});
  return std::unique_ptr<RestClient>(new RestClient(std::move(state)));
}

RestClient::RestClient(std::unique_ptr<State> state) : state_(std::move(state)) {}
RestClient::~RestClient() = default;

Result<std::string> RestClient::get(const std::string& path) { return state_->until_answered("GET", path); }

Result<std::string> RestClient::post(const std::string& path, const std::string& content_type,
                                     const std::string& body, const std::string& idempotency_key) {
  std::map<std::string, std::string> headers;
  if (!idempotency_key.empty()) headers.emplace("Idempotency-Key", idempotency_key);
  return state_->until_answered("POST", path, body, content_type, headers);
}

Result<std::string> read_token_file(const std::string& path) {
  if (path.empty()) {
    const char* given = std::getenv("ANCHORD_TOKEN");
    return std::string(given == nullptr ? "" : given);
  }
  return server::token_in(path);
}

}  // namespace anchord::cli
