#include "server/sync/peer.hpp"

#include <nlohmann/json.hpp>
#include <random>
#include <thread>
#include <utility>

#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "core/base/time.hpp"
#include "core/base/to_wire.hpp"
#include "server/gateway/answer.hpp"
#include "server/sync/spool.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;
using std::chrono::milliseconds;
using Monotonic = std::chrono::steady_clock;

/// Five million rows, the most of a bundle, are taken in within some minutes.
constexpr int k_bundle_answer_times = 20;
/// What a link must bring to count as one: a byte an attempt would go on for years.
constexpr std::uint64_t k_progress_bytes = std::uint64_t{16} << 10;
constexpr milliseconds k_first_pause{500}, k_longest_pause{15'000};
constexpr int k_most_long_attempts = 5;
constexpr std::size_t k_page = 500;
constexpr int k_most_pages = 10'000;  ///< five million items: more than any server has
constexpr std::size_t k_most_kept_bytes = std::size_t{64} << 20;

Errc errc_of(int status) {
  if (status == 404 || status == 410) return Errc::not_found;
  if (status == 409 || status == 412) return Errc::conflict;
  return Errc::invalid_argument;
}

double chance_of_pause() {
  static std::minstd_rand chance{std::random_device{}()};
  return std::uniform_real_distribution<double>(0, 1)(chance);
}

/// Of somebody on the way: no answer of a server is one, or redirects.
bool is_web_page(const server::ClientResponse& answer) {
  const auto type = answer.headers.find("content-type");
  const bool html = type != answer.headers.end() && type->second.starts_with("text/html");
  const bool redirects = answer.status >= 300 && answer.status < 400 && answer.status != 304;
  return redirects || (html && answer.status < 500);
}

bool again_later(int status) { return status == 408 || status == 425 || status == 429 || status >= 500; }

}  // namespace

const Json& member(const Json& object, const char* key) {
  static const Json none;
  const auto at = object.find(key);
  return at != object.end() ? *at : none;
}

std::string text_of(const Json& object, const char* key) {
  const Json& value = member(object, key);
  return value.is_string() ? value.get<std::string>() : std::string();
}

Json json_of(const server::ClientResponse& answer) {
  Json json;
  if (api::parse_json(answer.body, json)) return {};
  return json;
}

std::string path_of(std::string_view kind, std::string_view id, std::string_view rest) {
  return "/api/v1/" + std::string(kind) + '/' + api::percent_encoded(id) + std::string(rest);
}

std::string in_words(const server::ClientResponse& answer) {
  return std::to_string(answer.status) + " " + api::problem_text(answer.body);
}

Result<std::unique_ptr<Peer>> Peer::to(const PeerOptions& options) {
  BOOST_OUTCOME_TRY(auto quick, server::HttpClient::to(options.url, options.timeout));
  BOOST_OUTCOME_TRY(auto slow, server::HttpClient::to(options.url, options.timeout * k_bundle_answer_times));
  if (!options.token.empty()) {
    quick.set_header("Authorization", "Bearer " + options.token);
    slow.set_header("Authorization", "Bearer " + options.token);
  }
  return std::unique_ptr<Peer>(new Peer(options, std::move(quick), std::move(slow)));
}

Result<void> Peer::is_server(const std::string& target, const server::ClientResponse& head) const {
  if (!known_ || !is_web_page(head)) return boost::outcome_v2::success();
  return make_error(Errc::link_lost, target + ": a web page answers (" + std::to_string(head.status) +
                                         "), not the server: does this network want somebody to sign in?");
}

Result<server::ClientResponse> Peer::once(const PeerRequest& request) {
  const auto accepts = [&](const server::ClientResponse& head) { return is_server(request.target, head); };
  auto answer = (request.bundle ? slow_ : quick_)
                    .call(server::ClientRequest{.method = request.method,
                                                .target = request.target,
                                                .body = request.body,
                                                .content_type = request.type,
                                                .headers = request.headers,
                                                .from = request.from ? request.from->file() : nullptr,
                                                .from_at = request.from_at,
                                                .from_bytes = request.from_bytes,
                                                .into = request.into ? request.into->file() : nullptr,
                                                .into_at = request.into_at,
                                                .accepts = accepts,
                                                .begins = request.begins,
                                                .most_bytes = request.most_bytes});
  if (!answer && answer.error().code == Errc::bad_frame)
    return stranger(request.target, answer.error().message);
  if (!answer) return answer;
  if (auto accepted = accepts(answer.value()); !accepted)
    return make_error(accepted.error().code, options_.url + ": " + accepted.error().message);
  return answer;
}

Result<server::ClientResponse> Peer::go_on(const std::function<Result<server::ClientResponse>()>& attempt,
                                           const std::function<std::uint64_t()>& arrived) {
  gateway::Pauses pauses{k_first_pause, k_longest_pause};
  std::optional<Monotonic::time_point> away_since;
  std::string told;
  for (;;) {
    const auto before = arrived();
    auto answer = attempt();
    if (answer || answer.error().code != Errc::link_lost) return answer;
    if (arrived() >= before + k_progress_bytes) {
      pauses.reset();
      away_since.reset();
      told.clear();
    }
    const auto now = Monotonic::now();
    if (!away_since) away_since = now;
    // Whoever reads it may have to do something about the newest of them.
    if (std::exchange(told, answer.error().message) != answer.error().message)
      options_.report(told + "; going on, for " + std::to_string(options_.give_up.count()) +
                      " s without a link");
    const auto wait = pauses.next(chance_of_pause());
    if (now + wait > *away_since + options_.give_up) return answer;
    std::this_thread::sleep_for(wait);
  }
}

Result<server::ClientResponse> Peer::call(const PeerRequest& request) {
  gateway::Pauses pauses{k_first_pause, k_longest_pause};
  const std::string what = options_.url + " " + std::string(request.method) + " " + request.target + ": ";
  std::optional<Monotonic::time_point> away_since;
  std::string told;
  int long_attempts = 0;
  for (;;) {
    const auto began = Monotonic::now();
    auto answer = once(request);
    if (!answer && (request.once || answer.error().code != Errc::link_lost)) return answer;
    auto wait = pauses.next(chance_of_pause());
    std::string why = answer ? what + in_words(answer.value()) : answer.error().message;
    if (answer) {
      const auto& a = answer.value();
      if (a.status == 401 || a.status == 403)
        return make_error(Errc::invalid_argument, why + "; " + options_.token_option +
                                                      " must give a file with a token of that server (role " +
                                                      options_.role + ")");
      if (a.status == 507)
        return make_error(
            Errc::storage_full,
            why + "; the disk of that server is full: free some space, then run the command again");
      if (!again_later(a.status)) return answer;
      if (const auto header = a.headers.find("retry-after"); header != a.headers.end())
        wait = std::max(wait, gateway::retry_after(header->second, SystemClock{}.now()).value_or(wait));
    }
    // A large bundle that was on its way for long had a link: only the time without one counts. A server that
    // never answers at all looks the same, so that there is an end to it.
    const auto now = Monotonic::now();
    const bool had_link = now - began > options_.give_up && ++long_attempts <= k_most_long_attempts;
    if (!away_since || had_link) {
      away_since = now;
      told.clear();
    }
    if (std::exchange(told, why) != why)
      options_.report(why + "; trying again for " + std::to_string(options_.give_up.count()) + " s");
    if (now + wait > *away_since + options_.give_up) return make_error(Errc::link_lost, why);
    std::this_thread::sleep_for(wait);
  }
}

Error Peer::stranger(const std::string& target, const std::string& what) const {
  return make_error(Errc::invalid_argument, options_.url + " " + target + ": " + what +
                                                ": is this the address of an anchord server?");
}

Result<Json> Peer::get(const std::string& target) {
  BOOST_OUTCOME_TRY(const auto answer, call({"GET", target}));
  if (answer.status >= 300 && answer.status < 400)
    return stranger(target, "it redirects (" + std::to_string(answer.status) + ")");
  if (answer.status >= 300)
    return make_error(errc_of(answer.status), options_.url + " GET " + target + ": " + in_words(answer));
  auto json = json_of(answer);
  if (!json.is_object()) return stranger(target, "the answer is not a JSON object");
  return json;
}

Result<void> Peer::each(const std::string& target,
                        const std::function<Result<void>(const Json& item)>& take) {
  const std::string first =
      target + (target.find('?') == std::string::npos ? "?" : "&") + "limit=" + std::to_string(k_page);
  std::string cursor;
  for (int pages = 0; pages < k_most_pages; ++pages) {
    BOOST_OUTCOME_TRY(const auto page,
                      get(cursor.empty() ? first : first + "&cursor=" + api::percent_encoded(cursor)));
    const Json& items = page.contains("items") ? page["items"] : member(page, "features");
    if (!items.is_array()) return stranger(target, "the answer is not a list");
    if (items.size() > k_page)
      return stranger(target, "a page of the list has more items than were asked for");
    for (const auto& item : items) {
      if (!item.is_object()) return stranger(target, "an item of the list is not a JSON object");
      BOOST_OUTCOME_TRYV(take(item));
    }
    cursor = text_of(page, "next_cursor");
    if (cursor.empty()) return boost::outcome_v2::success();
  }
  return stranger(target, "the list has no end");
}

Result<std::vector<Json>> Peer::list(const std::string& target) {
  std::vector<Json> out;
  std::size_t bytes = 0;
  BOOST_OUTCOME_TRYV(each(target, [&](const Json& item) -> Result<void> {
    bytes += to_wire(item).size();
    if (bytes > k_most_kept_bytes)
      return stranger(target, "the list is longer than " + std::to_string(k_most_kept_bytes >> 20) + " MiB");
    out.push_back(item);
    return boost::outcome_v2::success();
  }));
  return out;
}

}  // namespace anchord::sync
