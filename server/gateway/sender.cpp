#include "server/gateway/sender.hpp"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <utility>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "server/gateway/delivery.hpp"
#include "server/http/http_client.hpp"
#include "server/runtime/token_file.hpp"

namespace anchord::gateway {
namespace {

using std::chrono::milliseconds;
using Monotonic = std::chrono::steady_clock;

/// A request that is not answered by then has lost its link: long enough for a second's worth of rows and a
/// commit, short enough to be back within ten seconds of the link.
constexpr milliseconds k_answer_time{8'000};
constexpr milliseconds k_first_pause{250}, k_longest_pause{2'400};               // of a lost link
constexpr milliseconds k_first_busy_pause{1'000}, k_longest_busy_pause{30'000};  // of a server in trouble
constexpr std::uint64_t k_least_piece{4u << 10}, k_first_piece{8u << 10}, k_most_piece{256u << 10};
constexpr double k_piece_s = 1.0;  ///< of the link: so long may live rows wait for the backlog
constexpr std::uint64_t k_rate_from_bytes{2u << 10};  ///< smaller requests measure the delay, not the rate
constexpr double k_delay_rise = 0.5;     ///< of the way to a longer delay; a shorter one counts at once
constexpr double k_least_sending = 0.1;  ///< of what a request took: so much at least was sending, not delay
constexpr milliseconds k_ask_idle{1'000}, k_ask_recording{5'000}, k_ask_forbidden{30'000};
constexpr milliseconds k_hold_time{60'000};
constexpr milliseconds k_note_every{60'000};
constexpr milliseconds k_disk_every{1'000};
constexpr std::uint64_t k_most_answer_bytes{4u << 20};
/// A restart in flight goes on with its mission; one of the next morning must not.
constexpr double k_remember_s = 15 * 60;

/// The mission that has the devices of the server, in an answer to GET /missions.
Result<std::optional<MissionId>> holder_in(std::string_view body) {
  const auto json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object() || !json.contains("items") || !json["items"].is_array())
    return make_error(Errc::bad_frame, "not a list of missions");
  for (const auto& item : json["items"]) {
    if (!item.is_object() || !item.contains("devices") || !item["devices"].is_object()) continue;
    if (!item["devices"].contains("recording") || item["devices"]["recording"] != true) continue;
    if (!item.contains("id") || !item["id"].is_string()) continue;
    BOOST_OUTCOME_TRY(const auto id, parse_uuid(item["id"].get<std::string>()));
    return std::optional(MissionId{id});
  }
  return std::optional<MissionId>{};
}

}  // namespace

class Sender::Impl {
 public:
  Impl(Outbox& outbox, SenderOptions options, server::HttpClient client)
      : outbox_(outbox),
        options_(std::move(options)),
        client_(std::move(client)),
        rejected_(options_.data_dir),
        delivery_(outbox_, rejected_, clock_, [this](const auto& target, auto type, const auto& body) {
          return post(target, type, body);
        }) {}
  ~Impl() { stop(); }

  Result<void> begin() {
    frontier_ = outbox_.state().newest_id;
    if (options_.mission) {
      BOOST_OUTCOME_TRY(const auto rows, outbox_.assign(*options_.mission));
      if (rows > 0)
        options_.log(std::to_string(rows) + " rows without a mission now belong to " +
                     to_string(*options_.mission));
      return boost::outcome_v2::success();
    }
    BOOST_OUTCOME_TRY(remembered_, outbox_.last_mission());
    return boost::outcome_v2::success();
  }

  void start() {
    if (options_.mission) {
      record(options_.mission, MissionFrom::given);
    } else if (remembered_ && std::abs(seconds_between(remembered_->at, clock_.now())) < k_remember_s) {
      record(remembered_->mission, MissionFrom::remembered);
    } else {
      record(unassigned(), MissionFrom::unassigned);
    }
    thread_ = Thread("anchord-send", [this] { run(); });
  }

  void stop() {
    {
      auto wake = wake_.lock();
      wake->stopping = true;
    }
    told_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

  void rows_came() {
    {
      auto wake = wake_.lock();
      wake->rows = true;
    }
    told_.notify_all();
  }

  SenderStatus status() const {
    auto out = status_.copy();
    const auto left = next_try_.copy() - Monotonic::now();
    out.next_try_s = std::max(0.0, std::chrono::duration<double>(left).count());
    return out;
  }

 private:
  void run() {
    while (!stopping()) {
      if (!guarded("sending", [this] { round(); })) wait(milliseconds(1'000), false);
    }
  }

  /// One step: waits, asks, or sends one piece of each kind.
  void round() {
    look_at_disk();
    if (const auto left = std::chrono::ceil<milliseconds>(next_try_.copy() - Monotonic::now());
        left.count() > 0) {
      wait(std::min(left, disk_trouble_.empty() ? left : k_disk_every), false);
      return;
    }
    release_held();
    if (Monotonic::now() >= ask_at_ && !ask()) return;
    bool sent = false;
    const auto live = send_live(sent);
    if (live == Turn::over) return;
    if (send_backlog(sent) == Turn::over || sent) return;
    wait(std::chrono::ceil<milliseconds>(ask_at_ - Monotonic::now()), true);
  }

  /// Where the disk took nothing: again, also when no row comes that would show it.
  void look_at_disk() {
    if (Monotonic::now() < disk_at_) return;
    disk_at_ = Monotonic::now() + k_disk_every;
    (void)outbox_.try_disk();
    const auto trouble = outbox_.state().trouble;
    if (trouble.empty() != disk_trouble_.empty())
      options_.log(trouble.empty() ? "rows are stored on the disk again"
                                   : "rows are not stored on the disk, and sent from memory: " + trouble);
    disk_trouble_ = trouble;
  }

  enum class Turn : std::uint8_t { goes_on, over };

  Turn send_live(bool& sent) {
    const auto found = outbox_.newest(frontier_, 2 * piece_);
    if (!found) return outbox_trouble(found.error());
    const auto& newest = found.value();
    if (newest.batches.empty()) return Turn::goes_on;
    const auto front = newest.batches.front();
    std::vector<Batch> batches(newest.batches.rbegin(), newest.batches.rend());
    if (send_groups(std::move(batches), sent) == Turn::over) return Turn::over;
    frontier_ = front.id;
    if (!held_until_.contains(front.mission)) update([&](auto& s) { s.newest_delivered = front.newest; });
    // What is live comes before what is not, also where the link has no room for all of it.
    return newest.more ? Turn::over : Turn::goes_on;
  }

  Turn send_backlog(bool& sent) {
    std::set<MissionId> held;
    for (const auto& [mission, until] : held_until_) held.insert(mission);
    auto found = outbox_.oldest(frontier_, held, piece_);
    if (!found) return outbox_trouble(found.error());
    if (found.value().empty()) return Turn::goes_on;
    return send_groups(std::move(found).value(), sent);
  }

  Turn send_groups(std::vector<Batch> batches, bool& sent) {
    for (const auto& group : grouped(std::move(batches))) {
      const auto mission = group.front().mission;
      if (held_until_.contains(mission)) continue;
      if (stopping()) return Turn::over;
      const auto outcome = delivery_.send(group);
      if (outcome.then == Then::hold)
        hold(mission, outcome.why);
      else if (!settle(outcome))
        rows_refused_ = outcome.link != Link::lost;
      if (outcome.then == Then::wait) return Turn::over;
      rows_refused_ = false;
      sent = true;
    }
    return Turn::goes_on;
  }

  Turn outbox_trouble(const Error& error) {
    options_.log("the outbox cannot be read: " + error.message);
    pause(k_first_busy_pause);
    return Turn::over;
  }

  /// False where the round ends: nothing can be sent now.
  bool settle(const Assessment& outcome) {
    if (outcome.link != Link::lost) update([&](auto& s) { s.last_answer = clock_.now(); });
    note(outcome.link, outcome.why);
    if (outcome.then != Then::wait) {
      lost_.reset();
      busy_.reset();
      return true;
    }
    if (outcome.link == Link::lost) piece_ = k_first_piece;
    const double chance = uniform_(random_);
    if (outcome.wait) {
      // Not before the server said, and not all gateways in the same instant.
      pause(*outcome.wait + milliseconds(static_cast<std::int64_t>(
                                250 + chance * 0.25 * static_cast<double>(outcome.wait->count()))));
    } else {
      pause((outcome.link == Link::lost ? lost_ : busy_).next(chance));
    }
    return false;
  }

  void note(Link link, const std::string& why) {
    const bool news = std::exchange(link_, link) != link;
    update([&](auto& s) {
      if (news) s.since = system_steady_clock().now();
      s.link = link;
      s.why = why;
    });
    if (news) options_.log("link " + std::string(k_link_words.word(link)) + (why.empty() ? "" : ": " + why));
  }

  void hold(const MissionId& mission, const std::string& why) {
    held_until_[mission] = Monotonic::now() + k_hold_time;
    bool news = false;
    update([&](auto& s) { news = s.held.insert_or_assign(mission, why).second; });
    note(Link::up, {});
    if (news) options_.log("rows of mission " + to_string(mission) + " wait: " + why);
  }
  void release_held() {
    std::erase_if(held_until_, [now = Monotonic::now()](const auto& one) { return one.second <= now; });
    update([this](auto& s) {
      std::erase_if(s.held, [this](const auto& one) { return !held_until_.contains(one.first); });
    });
  }

  // --- which mission ---------------------------------------------------------------------------------------
  /// False where the link is of no use now.
  bool ask() {
    if (options_.mission) return ask_whether_there();
    const auto answer = call("GET", "/api/v1/missions?limit=50&fields=id,devices", {}, {});
    ask_at_ = Monotonic::now() + (current_ ? k_ask_recording : k_ask_idle);
    if (!answer) return settle({Then::wait, Link::lost, answer.error().message, {}, {}});
    const auto& a = answer.value();
    if (a.status == 403) {
      // Rows may still be taken: the role gateway sends them and reads nothing.
      update([](auto& s) {
        s.mission_problem =
            "the gateway may not read which mission is recording: use a token that also has the role viewer, "
            "or give the mission with --mission";
      });
      ask_at_ = Monotonic::now() + k_ask_forbidden;
      return true;
    }
    const auto outcome = assess_question(a.status, a.headers, a.body, clock_.now());
    if (outcome.then == Then::wait) return settle(outcome);
    const auto holder = holder_in(a.body);
    if (!holder) return settle({Then::wait, Link::refused, holder.error().message, {}, {}});
    update([](auto& s) { s.mission_problem.clear(); });
    record(holder.value(), MissionFrom::server);
    return answered(outcome);
  }

  /// That a question is answered says nothing about rows that were refused before.
  bool answered(const Assessment& outcome) { return rows_refused_ || settle(outcome); }

  bool ask_whether_there() {
    const bool idle = link_ == Link::unknown || outbox_.state().rows == 0;
    ask_at_ = Monotonic::now() + k_ask_recording;
    if (!idle) return true;
    const auto answer = call("GET", "/healthz", {}, {});
    if (!answer) return settle({Then::wait, Link::lost, answer.error().message, {}, {}});
    return answered(
        assess_question(answer.value().status, answer.value().headers, answer.value().body, clock_.now()));
  }

  void record(const std::optional<MissionId>& mission, MissionFrom from) {
    const bool news = !recorded_ || current_ != mission;
    current_ = mission;
    recorded_ = true;
    update([&](auto& s) {
      s.mission = mission == unassigned() ? std::nullopt : mission;
      s.mission_from = from;
    });
    if (news) {
      options_.record_into(mission);
      options_.log(!mission ? std::string("no mission has the devices of the server: rows are not stored")
                   : mission == unassigned()
                       ? std::string("the server has not been asked yet: rows are stored without a mission")
                       : "rows are stored for mission " + to_string(*mission) + " (" +
                             std::string(k_mission_from_words.word(from)) + ")");
    }
    if (from != MissionFrom::server || !mission) return;
    if (!news && Monotonic::now() < note_at_) return;
    note_at_ = Monotonic::now() + k_note_every;
    if (const auto noted = outbox_.note_mission({*mission, clock_.now()}); !noted)
      options_.log("the mission cannot be stored: " + noted.error().message);
  }

  // --- requests --------------------------------------------------------------------------------------------
  Result<server::ClientResponse> call(std::string_view method, const std::string& target,
                                      const std::string& body, std::string_view type) {
    if (token_.empty() || link_ != Link::up) {
      const auto token = server::token_in(options_.token_file);
      token_ = token ? token.value() : std::string();
    }
    std::map<std::string, std::string> headers;
    if (!token_.empty()) headers.emplace("Authorization", "Bearer " + token_);
    const auto began = Monotonic::now();
    const auto sent = clock_.now();
    // On the networks of a field anybody may answer.
    auto answer = client_.call({.method = method,
                                .target = target,
                                .body = body,
                                .content_type = type.empty() ? "application/json" : type,
                                .headers = std::move(headers),
                                .most_bytes = k_most_answer_bytes});
    took_s_ = std::max(1e-4, std::chrono::duration<double>(Monotonic::now() - began).count());
    if (answer && body.size() < k_rate_from_bytes)
      delay_s_ =
          delay_s_ == 0 || took_s_ < delay_s_ ? took_s_ : delay_s_ + k_delay_rise * (took_s_ - delay_s_);
    const auto ahead_s = answer && answer.value().status < 300
                             ? clock_ahead_s(answer.value().headers, sent, clock_.now())
                             : std::nullopt;
    update([&](auto& s) {
      ++s.requests;
      if (ahead_s) s.clock_ahead_s = *ahead_s;
    });
    return answer;
  }

  Result<server::ClientResponse> post(const std::string& target, std::string_view type,
                                      const std::string& body) {
    auto answer = call("POST", target, body, type);
    if (!answer) return answer;
    auto status = status_.lock();
    status->bytes_sent += body.size();
    if (body.size() < k_rate_from_bytes || answer.value().status >= 300) return answer;
    // A link with a long delay is not a slow one: pieces that shrank with the delay would never fill it.
    const double sending_s = std::max(took_s_ - delay_s_, k_least_sending * took_s_);
    const double rate = static_cast<double>(body.size()) / sending_s;
    status->bytes_per_s = status->bytes_per_s == 0 ? rate : 0.5 * (status->bytes_per_s + rate);
    piece_ = std::clamp(static_cast<std::uint64_t>(status->bytes_per_s * std::max(k_piece_s, delay_s_)),
                        k_least_piece, std::min(k_most_piece, 2 * std::max(piece_, k_first_piece)));
    return answer;
  }

  void pause(milliseconds length) { (void)next_try_.exchange(Monotonic::now() + length); }
  template <class F>
  void update(F change) {
    auto status = status_.lock();
    change(*status);
  }
  bool stopping() const {
    const auto wake = wake_.lock();
    return wake->stopping;
  }
  void wait(milliseconds most, bool for_rows) {
    auto wake = wake_.lock();
    wake.wait_for(told_, most, [&](const Wake& w) { return w.stopping || (for_rows && w.rows); });
    wake->rows = false;
  }

  Outbox& outbox_;
  const SenderOptions options_;
  SystemClock clock_;
  server::HttpClient client_;
  RejectedFile rejected_;
  Delivery delivery_;

  // Of the sending thread.
  std::int64_t frontier_{0};  ///< what came later is live
  std::uint64_t piece_{k_first_piece};
  double took_s_{0}, delay_s_{0};  ///< the last request; one without a body to speak of
  Pauses lost_{k_first_pause, k_longest_pause}, busy_{k_first_busy_pause, k_longest_busy_pause};
  std::map<MissionId, Monotonic::time_point> held_until_;
  Monotonic::time_point ask_at_{}, note_at_{};
  std::optional<MissionId> current_{};
  bool recorded_{false};
  bool rows_refused_{false};  ///< the newest request with rows got an answer that was none
  Link link_{Link::unknown};
  std::optional<Outbox::LastMission> remembered_{};
  std::string token_;
  Monotonic::time_point disk_at_{};
  std::string disk_trouble_;
  std::minstd_rand random_{std::random_device{}()};
  std::uniform_real_distribution<double> uniform_{0, 1};

  struct Wake {
    bool stopping{false}, rows{false};
  };
  Locked<Wake> wake_;
  std::condition_variable told_;
  Locked<SenderStatus> status_;
  Locked<Monotonic::time_point> next_try_;
  Thread thread_;
};

Sender::Sender(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Sender::~Sender() = default;

Result<std::unique_ptr<Sender>> Sender::make(Outbox& outbox, SenderOptions options) {
  BOOST_OUTCOME_TRY(auto client, server::HttpClient::to(options.url, k_answer_time));
  auto impl = std::make_unique<Impl>(outbox, std::move(options), std::move(client));
  BOOST_OUTCOME_TRYV(impl->begin());
  return std::unique_ptr<Sender>(new Sender(std::move(impl)));
}

void Sender::start() { impl_->start(); }
void Sender::stop() { impl_->stop(); }
void Sender::rows_came() { impl_->rows_came(); }
SenderStatus Sender::status() const { return impl_->status(); }

}  // namespace anchord::gateway
