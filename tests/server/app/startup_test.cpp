// What `anchord config check` and the start of a server refuse of settings that are well written.
#include "server/app/startup.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace anchord::server::startup_test {
namespace {

namespace fs = std::filesystem;
using Settings = std::map<std::string, std::string>;

std::string refusal(Settings settings) {
  const auto config = load_config(settings, std::nullopt, {});
  if (!config) return "not well written: " + config.error().message;
  const auto checked = check_startup(config.value());
  return checked ? "" : checked.error().message;
}

TEST(Startup, OrdinarySettingsAreNoReasonNotToStart) {
  EXPECT_EQ(refusal({}), "");
  EXPECT_EQ(refusal({{"drone.address", "udp://127.0.0.1:14550"}, {"mqtt.host", "127.0.0.1"}}), "");
  EXPECT_EQ(refusal({{"devices", "gnss=serial:/dev/ttyACM0"}}), "") << "a device may come later";
}

TEST(Startup, SettingsWithWhichNoServerStartsAreNamedBeforeItIsTried) {
  const std::vector<std::pair<Settings, std::string>> cases{
      {{{"listen", "0.0.0.0:8420"}}, "0.0.0.0:8420"},
      {{{"tls.certificate", "/nowhere/cert.pem"}, {"tls.key", "/nowhere/key.pem"}}, "/nowhere/"},
      {{{"standby", "true"}}, "standby: a folder has one server"},
      {{{"trusted_proxies", "300.1.1.1"}}, "300.1.1.1"},
      {{{"devices", "gnss"}}, "is not kind=address"},
      {{{"devices", "gnss=foo"}}, "devices: "},
      {{{"drone.address", "tcp://"}}, "drone.address: "},
      {{{"drone.address", "udp://0.0.0.0:14560"}}, "can be reached from other machines"},
      {{{"drone.address", "udp://127.0.0.1:1"}, {"drone.signing_key_file", "/nowhere/key"}},
       "drone.signing_key_file: "},
      {{{"mqtt.host", "127.0.0.1"}, {"mqtt.user", "u"}, {"mqtt.password_file", "/nowhere/word"}},
       "mqtt.password_file: "},
      {{{"mqtt.host", "127.0.0.1"}, {"mqtt.port", "70000"}}, "mqtt.port: 70000"},
  };
  for (const auto& [settings, named] : cases)
    EXPECT_NE(refusal(settings).find(named), std::string::npos)
        << settings.begin()->first << ": " << refusal(settings);
}

}  // namespace
}  // namespace anchord::server::startup_test
