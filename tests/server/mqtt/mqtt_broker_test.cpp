// What is published, against a real Eclipse Mosquitto: retained, after its restart, by TLS and password, and
// what becomes of it while the broker is away, slow or dead. Read by mosquitto_sub.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "core/base/locked.hpp"
#include "server/mqtt/mqtt_broker.hpp"
#include "tests/server/mqtt/mosquitto.hpp"
#include "tests/server/storage/child.hpp"

namespace anchord::test::mqtt_broker_test {
namespace {

using namespace std::chrono_literals;
using server::MqttOptions;

/// A state that the test sets; counts how often it is asked.
class Source final : public BrokerSource {
 public:
  std::vector<BrokerMessage> changes(bool everything) override {
    auto state = state_.lock();
    ++state->asked;
    if (everything) state->sent.clear();
    std::vector<BrokerMessage> out;
    for (const auto& [topic, payload] : state->now) {
      auto& before = state->sent[topic];
      if (before != payload) out.push_back({topic, before = payload, topic.ends_with("/alarms")});
    }
    return out;
  }
  BrokerMessage presence(bool online) override {
    return {"anchord/_server/status", online ? "online" : "offline", true};
  }
  void set(const std::string& topic, std::string payload) {
    auto state = state_.lock();
    state->now[topic] = std::move(payload);
  }
  int asked() const {
    const auto state = state_.lock();
    return state->asked;
  }

 private:
  struct State {
    std::map<std::string, std::string> now, sent;
    int asked{0};
  };
  Locked<State> state_;
};

class MqttBroker : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!Mosquitto::installed()) GTEST_SKIP() << "SKIP: mosquitto is not installed";
    std::signal(SIGPIPE, SIG_IGN);  // as the server does
  }
  MqttOptions options(int port) const {
    MqttOptions out;
    out.host = "localhost";
    out.port = static_cast<std::uint16_t>(port);
    out.period = 50ms;
    out.first_wait = 20ms;
    out.longest_wait = 100ms;
    return out;
  }
  static std::unique_ptr<Broker> started(const MqttOptions& options, Source& source) {
    auto made = server::make_mqtt_broker(options);
    EXPECT_TRUE(made) << made.error().message;
    if (!made) return nullptr;
    made.value()->start(source);
    return std::move(made).value();
  }
  static bool connected(const Broker& broker) {
    return eventually([&] { return broker.status().connected; });
  }
};

TEST_F(MqttBroker, PublishesRetainedAndSaysWhetherItIsThere) {
  Mosquitto mosquitto;
  ASSERT_TRUE(mosquitto.start());
  Source source;
  source.set("anchord/ghent/estimates/0x6a2f", R"({"h95_m":0.1})");
  source.set("anchord/_server/alarms", "[]");
  auto broker = started(options(mosquitto.port()), source);
  const auto got = mosquitto.read("anchord/#", 3);
  EXPECT_EQ(got.at("anchord/ghent/estimates/0x6a2f"), R"({"h95_m":0.1})");
  EXPECT_EQ(got.at("anchord/_server/status"), "online");
  // Retained, with the QoS it was published with.
  EXPECT_EQ(mosquitto.read_one("anchord/ghent/estimates/0x6a2f"), R"(1 0 {"h95_m":0.1})");
  EXPECT_EQ(mosquitto.read_one("anchord/_server/alarms"), "1 1 []");
  EXPECT_TRUE(broker->status().connected);
  EXPECT_EQ(broker->status().address, "localhost:" + std::to_string(mosquitto.port()));
  EXPECT_EQ(broker->status().reason, "");
  EXPECT_GE(broker->status().messages, 3u);
  broker->stop();
  EXPECT_EQ(mosquitto.read_one("anchord/_server/status"), "1 1 offline");
  EXPECT_EQ(mosquitto.read_one("anchord/_server/alarms"), "1 1 []") << "the rest stays";
}

TEST_F(MqttBroker, LeavesAWillThatSaysItIsGoneWhenItsProcessIsKilled) {
  Mosquitto mosquitto;
  ASSERT_TRUE(mosquitto.start());
  const int port = mosquitto.port();
  Child server([&](int) {
    Source source;
    const auto broker = started(options(port), source);
    ::pause();
    return 0;
  });
  EXPECT_TRUE(eventually([&] { return mosquitto.read_one("anchord/_server/status") == "1 1 online"; }));
  server.kill_now();
  EXPECT_TRUE(eventually([&] { return mosquitto.read_one("anchord/_server/status") == "1 1 offline"; }));
}

TEST_F(MqttBroker, PublishesEverythingAgainAfterTheBrokerWasKilledAndCameBack) {
  Mosquitto mosquitto;
  ASSERT_TRUE(mosquitto.start());
  Source source;
  source.set("anchord/ghent/anchors/0x6a2f", "1");
  auto broker = started(options(mosquitto.port()), source);
  ASSERT_TRUE(connected(*broker));
  mosquitto.kill_now();
  ASSERT_TRUE(eventually([&] { return !broker->status().connected; }));
  EXPECT_NE(broker->status().reason, "");
  EXPECT_TRUE(eventually([&] { return broker->status().failures >= 3; })) << "it tries again";
  EXPECT_NE(broker->status().reason.find("refused"), std::string::npos) << broker->status().reason;
  source.set("anchord/ghent/anchors/0x6a2f", "2");
  ASSERT_TRUE(mosquitto.start());
  EXPECT_EQ(mosquitto.read("anchord/ghent/#", 1).at("anchord/ghent/anchors/0x6a2f"), "2");
  ASSERT_TRUE(connected(*broker));
  EXPECT_EQ(broker->status().connections, 2u);
}

TEST_F(MqttBroker, SkipsStatesForABrokerThatStandsStillAndCatchesUpWithTheNewest) {
  Mosquitto mosquitto;
  ASSERT_TRUE(mosquitto.start());
  Source source;
  auto broker = started(options(mosquitto.port()), source);
  ASSERT_TRUE(eventually([&] { return source.asked() > 1; })) << "its presence is acknowledged";
  mosquitto.signal(SIGSTOP);
  // More than the sockets of both ends hold, so that the message cannot leave.
  source.set("anchord/big/mission", std::string(20'000'000, 'x'));
  const auto sent = broker->status().messages;
  ASSERT_TRUE(eventually([&] { return broker->status().messages > sent; }));
  const int asked = source.asked();
  for (int i = 0; i < 1000; ++i) source.set("anchord/ghent/mission", std::to_string(i));
  // The thread is alive all the while: a second round of its keep-alive check has passed.
  const auto end = std::chrono::steady_clock::now() + 1200ms;
  while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
  EXPECT_EQ(source.asked(), asked) << "nothing is asked for before what was sent has left";
  mosquitto.signal(SIGCONT);
  EXPECT_TRUE(eventually([&] { return mosquitto.read_one("anchord/ghent/mission") == "1 0 999"; }));
  EXPECT_LT(broker->status().messages, sent + 10) << "newest wins";
}

TEST_F(MqttBroker, StopsAtOnceWhereNobodyAnswersAndSaysSo) {
  // A listener that takes connections and never says a word.
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&at), size), 0);
  ASSERT_EQ(::listen(fd, 16), 0);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&at), &size);
  Source source;
  auto slow = options(ntohs(at.sin_port));
  slow.answer = 1000ms;
  auto broker = started(slow, source);
  EXPECT_TRUE(eventually([&] { return broker->status().reason == "no answer from the broker within 1 s"; }))
      << broker->status().reason;
  EXPECT_EQ(source.asked(), 0);
  const auto begun = std::chrono::steady_clock::now();
  broker->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 1s);
  ::close(fd);
}

/// A private authority and a certificate of it for localhost, by openssl's own tool.
void make_certificates(const std::filesystem::path& folder) {
  const std::string cd = "cd " + folder.string() + " && openssl ";
  const std::string key = " -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes ";
  std::string said;
  for (const char* name : {"ca", "other"})
    said += output_of(cd + "req -x509" + key + "-keyout " + name + ".key -out " + name +
                      ".pem -days 2 -subj /CN=" + name);
  std::ofstream(folder / "san") << "subjectAltName=DNS:localhost\n";
  said += output_of(cd + "req" + key + "-keyout broker.key -out broker.csr -subj /CN=broker");
  said += output_of(cd +
                    "x509 -req -in broker.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -extfile san "
                    "-out broker.pem");
  ASSERT_TRUE(std::filesystem::exists(folder / "broker.pem")) << said;
}

TEST_F(MqttBroker, SpeaksTlsWithAPasswordAndBelievesNoOtherCertificateOrName) {
  Mosquitto files;  // for its folder alone
  make_certificates(files.folder());
  const std::string at = files.folder();
  ASSERT_EQ(output_of("touch " + at + "/users && chmod 600 " + at + "/users && mosquitto_passwd -b " + at +
                      "/users anchord secret"),
            "");
  Mosquitto mosquitto("allow_anonymous false\npassword_file " + at + "/users\ncertfile " + at +
                      "/broker.pem\nkeyfile " + at + "/broker.key\n");
  ASSERT_TRUE(mosquitto.start());
  Source source;
  source.set("anchord/ghent/mission", "1");
  auto good = options(mosquitto.port());
  good.ca_file = at + "/ca.pem";
  good.user = "anchord";
  good.password = "secret";
  const auto broker = started(good, source);
  ASSERT_TRUE(connected(*broker)) << broker->status().reason;
  EXPECT_TRUE(broker->status().tls);
  EXPECT_EQ(mosquitto.read("anchord/ghent/#", 1, "-u anchord -P secret --cafile " + at + "/ca.pem")
                .at("anchord/ghent/mission"),
            "1");
  const auto why = [&](const MqttOptions& options) {
    const auto other = started(options, source);
    EXPECT_TRUE(eventually([&] { return other->status().failures > 0; }));
    EXPECT_EQ(other->status().connections, 0u);
    return other->status().reason;
  };
  auto wrong = good;
  wrong.password = "guess";
  EXPECT_EQ(why(wrong), "refused by the broker: Connection Refused: not authorised.");
  wrong = good;
  wrong.ca_file = at + "/other.pem";
  EXPECT_NE(why(wrong).find("TLS"), std::string::npos) << why(wrong);
  wrong = good;
  wrong.host = "127.0.0.1";  // the certificate names localhost
  EXPECT_NE(why(wrong).find("TLS"), std::string::npos) << why(wrong);
  wrong = good;
  wrong.ca_file.clear();  // plain text to a TLS port
  EXPECT_NE(why(wrong), "");
  wrong = good;
  wrong.ca_file = at + "/absent.pem";
  const auto none = server::make_mqtt_broker(wrong);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("absent.pem"), std::string::npos);
}

TEST(MqttPassword, IsTheFirstLineOfAFileThatNobodyElseMayRead) {
  Mosquitto files;
  const std::string file = files.folder() / "password";
  EXPECT_EQ(server::read_mqtt_password(file).error().code, Errc::not_found);
  std::ofstream(file) << "secret\r\nsecond line\n";
  ::chmod(file.c_str(), 0644);
  EXPECT_EQ(server::read_mqtt_password(file).error().code, Errc::invalid_argument);
  ::chmod(file.c_str(), 0600);
  EXPECT_EQ(server::read_mqtt_password(file).value(), "secret");
  std::ofstream(file) << "\n";
  EXPECT_EQ(server::read_mqtt_password(file).error().code, Errc::invalid_argument);
}

}  // namespace
}  // namespace anchord::test::mqtt_broker_test
