#include "server/sync/peer.hpp"

#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "api/measurements/flight_requests.hpp"
#include "core/base/time.hpp"
#include "server/gateway/answer.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;
using std::chrono::milliseconds;
using Monotonic = std::chrono::steady_clock;

/// A bundle of 50 MB takes half an hour of a slow link, and the import of a million rows some seconds.
constexpr milliseconds k_answer_time = std::chrono::minutes(60);
constexpr milliseconds k_first_pause{500}, k_longest_pause{15'000}, k_look_every{100};

Errc errc_of(int status) {
  if (status == 404 || status == 410) return Errc::not_found;
  if (status == 409 || status == 412) return Errc::conflict;
  if (status == 507) return Errc::storage_full;
  return Errc::invalid_argument;
}

bool again_later(int status) {
  return status == 408 || status == 425 || status == 429 || (status >= 500 && status != 507);
}

}  // namespace

std::string text_of(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string();
}

std::string told(const server::ClientResponse& answer) {
  return std::to_string(answer.status) + " " + api::problem_text(answer.body);
}

Result<std::unique_ptr<Peer>> Peer::to(const PeerOptions& options) {
  BOOST_OUTCOME_TRY(auto client, server::HttpClient::to(options.url, k_answer_time));
  if (!options.token.empty()) client.set_header("Authorization", "Bearer " + options.token);
  return std::unique_ptr<Peer>(new Peer(options, std::move(client)));
}

bool Peer::pause(milliseconds length) const {
  const auto until = Monotonic::now() + length;
  while (Monotonic::now() < until) {
    if (options_.cancelled()) return false;
    std::this_thread::sleep_for(std::min<Monotonic::duration>(k_look_every, until - Monotonic::now()));
  }
  return !options_.cancelled();
}

Result<server::ClientResponse> Peer::call(std::string_view method, const std::string& target,
                                          const std::string& body, std::string_view type) {
  static std::minstd_rand chance{std::random_device{}()};
  gateway::Pauses pauses{k_first_pause, k_longest_pause};
  const auto began = Monotonic::now();
  for (;;) {
    if (options_.cancelled()) return make_error(Errc::canceled, "stopped");
    auto answer = client_.call(method, target, body, type);
    const std::string what = options_.url + " " + std::string(method) + " " + target + ": ";
    auto wait = pauses.next(std::uniform_real_distribution<double>(0, 1)(chance));
    if (answer) {
      const auto& a = answer.value();
      if (a.status == 401 || a.status == 403)
        return make_error(
            Errc::invalid_argument,
            what + told(a) + "; --token-file names a file with a token of that server (engineer)");
      if (!again_later(a.status)) return answer;
      const auto header = a.headers.find("retry-after");
      if (header != a.headers.end())
        wait = std::max(wait, gateway::retry_after(header->second, SystemClock{}.now()).value_or(wait));
    }
    if (Monotonic::now() + wait > began + options_.give_up)
      return make_error(Errc::link_lost, answer ? what + told(answer.value()) : answer.error().message);
    if (!pause(wait)) return make_error(Errc::canceled, "stopped");
  }
}

Result<Json> Peer::get(const std::string& target) {
  BOOST_OUTCOME_TRY(const auto answer, call("GET", target));
  if (answer.status >= 300)
    return make_error(errc_of(answer.status), options_.url + " GET " + target + ": " + told(answer));
  auto json = Json::parse(answer.body, nullptr, false);
  if (!json.is_object())
    return make_error(Errc::invalid_argument,
                      options_.url + " GET " + target + ": the answer is no JSON object");
  return json;
}

Result<std::vector<Json>> Peer::list(const std::string& target) {
  std::vector<Json> out;
  const std::string first = target + (target.find('?') == std::string::npos ? "?" : "&") + "limit=1000";
  std::string cursor;
  for (;;) {
    BOOST_OUTCOME_TRY(const auto page, get(cursor.empty() ? first : first + "&cursor=" + cursor));
    for (const char* key : {"items", "features"}) {
      if (page.contains(key) && page[key].is_array())
        out.insert(out.end(), page[key].begin(), page[key].end());
    }
    cursor = text_of(page, "next_cursor");
    if (cursor.empty()) return out;
  }
}

}  // namespace anchord::sync
