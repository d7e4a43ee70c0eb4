#include "server/mqtt/mqtt_broker.hpp"

#include <mosquitto.h>
#include <poll.h>
#include <resolv.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>
#include <random>

#include "core/base/guard.hpp"
#include "core/base/ids.hpp"
#include "core/base/locked.hpp"

namespace anchord::server {
namespace {

using Steady = std::chrono::steady_clock;
using std::chrono::milliseconds;
constexpr milliseconds k_farewell{500};  ///< that a stop may take for its last message
constexpr double k_jitter = 0.25;        ///< share of a wait drawn at random: not all servers at once

/// mosquitto_lib_init() is not thread-safe, and is undone by nobody: the library keeps no thread or file.
void init_library() {
  static const int done = mosquitto_lib_init();
  (void)done;
}

/// What ended or refused a connection, in words.
std::string words_of(int code) {
  if (code == MOSQ_ERR_ERRNO) return std::strerror(errno);
  return mosquitto_strerror(code);
}

struct Free {
  void operator()(mosquitto* client) const { mosquitto_destroy(client); }
};
using Client = std::unique_ptr<mosquitto, Free>;

class MqttBroker final : public Broker {
 public:
  MqttBroker(MqttOptions options, int wake) : options_(std::move(options)), wake_(wake), chance_(seed()) {}
  ~MqttBroker() override {
    stop();
    ::close(wake_);
  }

  /// The client of one connection, with all but the last will.
  Result<Client> client() {
    init_library();
    const std::string id = "anchord-" + std::to_string(chance_());
    Client made(mosquitto_new(id.c_str(), true, this));
    if (!made) throw std::bad_alloc();
    if (!options_.user.empty())
      mosquitto_username_pw_set(made.get(), options_.user.c_str(),
                                options_.password.empty() ? nullptr : options_.password.c_str());
    if (!options_.ca_file.empty()) {
      const int rc =
          mosquitto_tls_set(made.get(), options_.ca_file.c_str(), nullptr, nullptr, nullptr, nullptr);
      if (rc != MOSQ_ERR_SUCCESS)
        return make_error(Errc::invalid_argument, options_.ca_file +
                                                      ": cannot be read as certificates of authorities (" +
                                                      words_of(rc) + "): name a PEM file");
      mosquitto_tls_opts_set(made.get(), 1, "tlsv1.2", nullptr);
    }
    return made;
  }

  void start(BrokerSource& source) override {
    source_ = &source;
    thread_ = Thread("anchord-mqtt", [this] { run(); });
  }

  BrokerStatus status() const override {
    const auto state = state_.lock();
    BrokerStatus out = state->shown;
    out.address = options_.host + ':' + std::to_string(options_.port);
    out.tls = !options_.ca_file.empty();
    out.in_state_s = std::chrono::duration<double>(Steady::now() - state->since).count();
    return out;
  }

  void stop() override {
    {
      auto state = state_.lock();
      state->stopped = true;
    }
    const std::uint64_t one = 1;
    (void)!::write(wake_, &one, sizeof one);
    if (thread_.joinable()) thread_.join();
  }

 private:
  struct State {
    BrokerStatus shown{.connected = false, .address = {}, .tls = false, .reason = "connecting"};
    Steady::time_point since{Steady::now()};
    bool stopped{false};
  };
  /// Of one connection; the thread's own.
  struct Link {
    mosquitto* client{nullptr};
    bool accepted{false}, everything{true};
    int refused{0};          ///< by the broker, with its code
    std::int64_t unsent{0};  ///< messages that have not left, or not been acknowledged where they are to be
    Steady::time_point next{};
  };

  static std::uint32_t seed() {
    std::random_device device;
    return device();
  }
  bool stopped() const {
    const auto state = state_.lock();
    return state->stopped;
  }
  void show(bool connected, std::string reason) {
    auto state = state_.lock();
    if (state->shown.connected != connected) state->since = Steady::now();
    state->shown.connected = connected;
    state->shown.reason = std::move(reason);
    ++(connected ? state->shown.connections : state->shown.failures);
  }

  void run() {
    // The library looks names up and waits for it. These hold for this thread alone: a name server that does
    // not answer must not make a stop wait for half a minute.
    if (res_init() == 0) {
      _res.retrans = 2;
      _res.retry = 1;
    }
    auto wait = options_.first_wait;
    while (!stopped()) {
      std::string why = "a fault of the server: see its log";
      bool was_connected = false;
      (void)guarded("mqtt", [&] { why = session(was_connected); });
      if (stopped()) return;
      show(false, std::move(why));
      if (was_connected) wait = options_.first_wait;
      const double share = 1 + k_jitter * std::uniform_real_distribution<>(-1, 1)(chance_);
      sleep_until(Steady::now() + std::chrono::duration_cast<milliseconds>(wait * share));
      wait = std::min(2 * wait, options_.longest_wait);
    }
  }

  void sleep_until(Steady::time_point end) {
    while (!stopped() && Steady::now() < end) {
      pollfd one{wake_, POLLIN, 0};
      (void)::poll(&one, 1, millis_to(end));
    }
  }
  static int millis_to(Steady::time_point end) {
    const auto left = std::chrono::ceil<milliseconds>(end - Steady::now()).count();
    return static_cast<int>(std::clamp<std::int64_t>(left, 0, 1'000));
  }

  /// One connection from its beginning to its end; why it ended.
  std::string session(bool& was_connected) {
    auto made = client();
    if (!made) return made.error().message;
    Link link;
    link.client = made.value().get();
    link_ = &link;
    const auto forget = [this](int*) { link_ = nullptr; };
    int scope = 0;
    const std::unique_ptr<int, decltype(forget)> at_end(&scope, forget);
    mosquitto_connect_callback_set(link.client, [](mosquitto*, void* self, int code) {
      auto& l = *static_cast<MqttBroker*>(self)->link_;
      l.accepted = code == 0;
      l.refused = code;
    });
    mosquitto_publish_callback_set(
        link.client, [](mosquitto*, void* self, int) { --static_cast<MqttBroker*>(self)->link_->unsent; });
    const auto will = source_->presence(false);
    mosquitto_will_set(link.client, will.topic.c_str(), static_cast<int>(will.payload.size()),
                       will.payload.data(), 1, true);
    const int begun = mosquitto_connect_async(link.client, options_.host.c_str(), options_.port,
                                              static_cast<int>(options_.keep_alive.count()));
    if (begun != MOSQ_ERR_SUCCESS && begun != MOSQ_ERR_CONN_PENDING) return words_of(begun);
    const auto answer_by = Steady::now() + options_.answer;
    while (!stopped()) {
      if (!link.accepted && Steady::now() > answer_by)
        return "no answer from the broker within " + std::to_string(options_.answer.count() / 1000) + " s";
      if (const int rc = step(link, link.accepted ? link.next : answer_by); rc != MOSQ_ERR_SUCCESS)
        return link.refused != 0
                   ? "refused by the broker: " + std::string(mosquitto_connack_string(link.refused))
                   : words_of(rc);
      if (!link.accepted) continue;
      if (!std::exchange(was_connected, true)) {
        show(true, "");
        if (const int rc = publish(link, source_->presence(true)); rc != MOSQ_ERR_SUCCESS)
          return words_of(rc);
      }
      if (link.unsent > 0 || Steady::now() < link.next) continue;
      link.next = Steady::now() + options_.period;
      for (const auto& message : source_->changes(std::exchange(link.everything, false))) {
        if (const int rc = publish(link, message); rc != MOSQ_ERR_SUCCESS) return words_of(rc);
      }
    }
    if (link.accepted) farewell(link);
    return "the server is stopping";
  }

  int publish(Link& link, const BrokerMessage& message) {
    ++link.unsent;
    const int rc = mosquitto_publish(link.client, nullptr, message.topic.c_str(),
                                     static_cast<int>(message.payload.size()), message.payload.data(),
                                     message.at_least_once ? 1 : 0, true);
    if (rc == MOSQ_ERR_SUCCESS) {
      auto state = state_.lock();
      ++state->shown.messages;
    }
    return rc;
  }

  /// What the socket has and takes now, or nothing until `until` (a second at most).
  int step(Link& link, Steady::time_point until) {
    const int socket = mosquitto_socket(link.client);
    if (socket < 0) return MOSQ_ERR_NO_CONN;
    const bool writes = mosquitto_want_write(link.client);
    const auto events = static_cast<short>(writes ? POLLIN | POLLOUT : POLLIN);
    std::array<pollfd, 2> fds{pollfd{socket, events, 0}, pollfd{wake_, POLLIN, 0}};
    // While messages are on their way there is nothing to do before the socket says so.
    const int most = link.unsent > 0 ? 1'000 : millis_to(until);
    if (::poll(fds.data(), fds.size(), most) < 0 && errno != EINTR) return MOSQ_ERR_ERRNO;
    if ((fds[0].revents & (POLLIN | POLLHUP | POLLERR)) != 0) {
      if (const int rc = mosquitto_loop_read(link.client, 1); rc != MOSQ_ERR_SUCCESS) return rc;
    }
    if ((fds[0].revents & POLLOUT) != 0) {
      if (const int rc = mosquitto_loop_write(link.client, 1); rc != MOSQ_ERR_SUCCESS) return rc;
    }
    return mosquitto_loop_misc(link.client);
  }

  /// A clean end: the broker keeps quiet about the last will, so it is said here.
  void farewell(Link& link) {
    const auto end = Steady::now() + k_farewell;
    if (publish(link, source_->presence(false)) != MOSQ_ERR_SUCCESS) return;
    bool alive = true;
    while (alive && link.unsent > 0 && Steady::now() < end) {
      const int socket = mosquitto_socket(link.client);
      if (socket < 0) return;
      const auto events = static_cast<short>(mosquitto_want_write(link.client) ? POLLIN | POLLOUT : POLLIN);
      pollfd one{socket, events, 0};
      (void)::poll(&one, 1, millis_to(end));
      alive = mosquitto_loop_read(link.client, 1) == MOSQ_ERR_SUCCESS &&
              mosquitto_loop_write(link.client, 1) == MOSQ_ERR_SUCCESS;
    }
    if (alive) mosquitto_disconnect(link.client);
  }

  const MqttOptions options_;
  const int wake_;
  std::mt19937 chance_;
  BrokerSource* source_{nullptr};
  Link* link_{nullptr};  ///< the thread's own
  Locked<State> state_;
  Thread thread_;
};

}  // namespace

Result<std::unique_ptr<Broker>> make_mqtt_broker(MqttOptions options) {
  const int wake = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake < 0) return make_error(Errc::storage_unavailable, std::string("eventfd: ") + std::strerror(errno));
  auto out = std::make_unique<MqttBroker>(std::move(options), wake);
  BOOST_OUTCOME_TRYV(out->client());
  return std::unique_ptr<Broker>(std::move(out));
}

Result<std::string> read_mqtt_password(const std::string& file) {
  struct stat found {};
  if (::stat(file.c_str(), &found) != 0) return make_error(Errc::not_found, file + ": there is no such file");
  if ((found.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    return make_error(Errc::invalid_argument,
                      file + ": others may read this password; set its permissions to 0600 (chmod 600)");
  std::ifstream in(file);
  std::string line;
  if (!std::getline(in, line) || line.empty())
    return make_error(Errc::invalid_argument, file + ": no password in its first line");
  if (line.ends_with('\r')) line.pop_back();
  return line;
}

}  // namespace anchord::server
