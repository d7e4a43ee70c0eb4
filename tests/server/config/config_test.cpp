#include "server/config/config.hpp"
#include "server/config/listeners.hpp"
#include "tests/paths.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "server/runtime/log_line.hpp"
#include "server/storage/sqlite_database.hpp"

namespace anchord::server::config_test {
namespace {

class ConfigFile {
 public:
  explicit ConfigFile(const std::string& text)
      : path_(std::filesystem::temp_directory_path() /
              ("anchord_config_" + std::to_string(getpid()) + ".toml")) {
    std::ofstream(path_) << text;
  }
  ~ConfigFile() { std::filesystem::remove(path_); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// "a|b|c".
template <class T, std::size_t N>
std::string choices_of(const EnumTable<T, N>& table) {
  std::string out;
  for (const auto word : table.words()) out.append(out.empty() ? "" : "|").append(word);
  return out;
}

TEST(Config, OffersTheWordsOfTheEnumsItSets) {
  const auto offered = [](std::string_view key) {
    const auto at = std::ranges::find(options(), key, &Option::key);
    return at == options().end() ? std::string("no such option") : std::string(at->choices);
  };
  EXPECT_EQ(offered("log_level"), choices_of(k_log_level_words));
  EXPECT_EQ(offered("storage.synchronous"), choices_of(k_synchronous_words));
}

TEST(Config, TakesFlagsOverEnvironmentOverFileOverDefaults) {
  const ConfigFile file(
      "listen = [\"127.0.0.1:1\", \"[::1]:1\"]\nlog_level = \"debug\"\n[http]\nworkers = 2\nhead_s = 0.5\n");
  const auto config = load_config({{"http.workers", "9"}}, file.path(),
                                  {"ANCHORD_HTTP_WORKERS=5", "ANCHORD_LOG_LEVEL=error"});
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config.value().count("http.workers"), 9u);
  EXPECT_EQ(config.value().text("log_level"), "error");
  EXPECT_EQ(config.value().list("listen"), (std::vector<std::string>{"127.0.0.1:1", "[::1]:1"}));
  EXPECT_EQ(config.value().seconds("http.head_s"), std::chrono::milliseconds(500));
  EXPECT_EQ(config.value().text("auth"), "on");
  EXPECT_EQ(config.value().values.find("http.workers")->second.origin, Origin::flag);
  EXPECT_EQ(config.value().values.find("log_level")->second.origin, Origin::environment);
  EXPECT_EQ(config.value().values.find("listen")->second.origin, Origin::file);
  EXPECT_EQ(config.value().values.find("auth")->second.origin, Origin::standard);
}

TEST(Config, TellsEveryFaultAtOnce) {
  const ConfigFile file("auht = \"off\"\n[http]\nworkers = \"many\"\n");
  const auto config = load_config({{"auth", "maybe"}}, file.path(), {"ANCHORD_HTTP_HEAD_S=-1"});
  ASSERT_FALSE(config);
  for (const char* part : {"auht", "http.workers", "--auth", "ANCHORD_HTTP_HEAD_S"}) {
    EXPECT_NE(config.error().message.find(part), std::string::npos) << part;
  }
}

TEST(Config, NamesLineAndColumnOfBrokenToml) {
  const ConfigFile file("listen = \n");
  const auto config = load_config({}, file.path(), {});
  ASSERT_FALSE(config);
  EXPECT_NE(config.error().message.find(":1:"), std::string::npos) << config.error().message;
}

TEST(Config, WarnsOfVariablesItDoesNotKnow) {
  const auto config = load_config({}, std::nullopt, {"ANCHORD_BINARY=/x", "PATH=/bin"});
  ASSERT_TRUE(config);
  EXPECT_EQ(config.value().warnings.size(), 1u);
}

TEST(Config, ShowsNoPasswordOfADatabaseItRefuses) {
  const auto config = load_config({{"database", "postgresql://anchord:secret@host/name"}}, std::nullopt, {});
  ASSERT_FALSE(config);
  EXPECT_THAT(config.error().message, testing::HasSubstr("--database = 'postgresql://host/name'"));
  EXPECT_THAT(config.error().message, testing::Not(testing::HasSubstr("secret")));
}

TEST(Config, TakesDaysOfRetentionOrOff) {
  const auto days = [](const std::string& text) {
    return load_config({{"missions.keep_cir_days", text}}, std::nullopt, {});
  };
  EXPECT_EQ(load_config({}, std::nullopt, {}).value().text("missions.keep_cir_days"), "off");
  EXPECT_EQ(days("90").value().count("missions.keep_cir_days"), 90u);
  EXPECT_EQ(days("off").value().count("missions.keep_cir_days"), 0u);
  for (const char* wrong : {"0", "1.5", "-1", "on", "", "36501"})
    EXPECT_THAT(days(wrong).error().message, testing::HasSubstr("must be off, or a whole number of days"))
        << wrong;
}

TEST(Config, EveryDefaultIsValid) { EXPECT_TRUE(load_config({}, std::nullopt, {})); }

TEST(Listeners, SpeakTlsWhenThereIsACertificateButForThoseThatSayOtherwise) {
  const auto listeners = [](const std::string& listen, bool certificate) {
    std::map<std::string, std::string> settings{{"listen", listen}};
    if (certificate) settings.insert({{"tls.certificate", "server.pem"}, {"tls.key", "server.key"}});
    std::string out;
    const auto found = listeners_of(load_config(settings, std::nullopt, {}).value());
    if (!found) return found.error().message;
    for (const auto& one : found.value()) out += one.address + (one.tls ? " tls;" : " plain;");
    return out;
  };
  EXPECT_EQ(listeners("127.0.0.1:1,[::1]:2", false), "127.0.0.1:1 plain;[::1]:2 plain;");
  EXPECT_EQ(listeners("0.0.0.0:8443, http://127.0.0.1:8420", true), "0.0.0.0:8443 tls;127.0.0.1:8420 plain;");
  EXPECT_EQ(listeners("https://0.0.0.0:8443", true), "0.0.0.0:8443 tls;");
  EXPECT_THAT(listeners("https://0.0.0.0:8443", false),
              ::testing::HasSubstr("needs tls.certificate and tls.key"));
  EXPECT_THAT(listeners(" , ", false), ::testing::HasSubstr("no address"));
  const auto half = load_config({{"tls.key", "server.key"}}, std::nullopt, {}).value();
  EXPECT_THAT(listeners_of(half).error().message, ::testing::HasSubstr("belong together"));
}

TEST(Listeners, BeyondLoopbackNeedTlsOrASayingThatThereIsNone) {
  const auto allowed = [](std::map<std::string, std::string> settings) {
    const auto config = load_config(settings, std::nullopt, {}).value();
    return static_cast<bool>(check_listeners(config, listeners_of(config).value()));
  };
  const std::pair<const std::string, std::string> certificate{"tls.certificate", "s.pem"},
      key{"tls.key", "s.key"};
  EXPECT_FALSE(allowed({{"listen", "0.0.0.0:1"}}));
  EXPECT_TRUE(allowed({{"listen", "0.0.0.0:1"}, {"insecure", "true"}}));
  EXPECT_TRUE(allowed({{"listen", "0.0.0.0:1"}, certificate, key}));
  EXPECT_FALSE(allowed({{"listen", "0.0.0.0:1, http://0.0.0.0:2"}, certificate, key}));
  EXPECT_TRUE(allowed({{"listen", "0.0.0.0:1, http://127.0.0.1:2"}, certificate, key}));
  EXPECT_FALSE(allowed({{"listen", "0.0.0.0:1"}, {"auth", "off"}, certificate, key}));
}

TEST(Config, SaysThatTheFileIsMissing) { EXPECT_FALSE(load_config({}, "/nowhere/anchord.toml", {})); }

}  // namespace
}  // namespace anchord::server::config_test
