#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "server/app/app.hpp"
#include "server/http/http_client.hpp"
#include "server/runtime/logging.hpp"

namespace anchord::test {

using Settings = std::map<std::string, std::string>;

/// The whole server in this process, on its own empty folder and a port of the system's choice.
class AppFixture {
 public:
  explicit AppFixture(Settings settings = {}) {
    std::string pattern = (std::filesystem::temp_directory_path() / "anchord app XXXXXX").string();
    folder = mkdtemp(pattern.data());
    server::start_logging("error");
    settings.try_emplace("listen", "127.0.0.1:0");
    settings["data_dir"] = (folder / "data").string();
    const auto config = server::load_config(settings, std::nullopt, {});
    auto started = server::App::start(config.value());
    if (started) {
      app = std::move(started).value();
      url = app->urls().front();
      port = static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1)));
      std::ifstream(folder / "data" / server::k_admin_token_file) >> admin;
    } else {
      error = started.error();
    }
  }
  ~AppFixture() {
    app.reset();
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
  }
  server::ClientResponse call(std::string_view method, std::string_view target, std::string_view body = {},
                              const std::map<std::string, std::string>& headers = {}) {
    auto client = server::HttpClient::to(url).value();
    for (const auto& [name, value] : headers) client.set_header(name, value);
    const auto answer = client.call(method, target, body);
    if (!answer) ADD_FAILURE() << method << " " << target << ": " << answer.error().message;
    return answer ? answer.value() : server::ClientResponse{};
  }
  std::map<std::string, std::string> bearer(const std::string& token) const {
    return {{"Authorization", "Bearer " + token}};
  }
  /// A new token with these roles.
  std::string token(const std::string& roles_json) {
    const auto made =
        call("POST", "/api/v1/tokens", R"({"name":"t","roles":)" + roles_json + "}", bearer(admin));
    const auto at = made.body.find("anc_");
    return at == std::string::npos ? std::string{} : made.body.substr(at, 4 + 32 + 1 + 64);
  }

  std::filesystem::path folder;
  std::unique_ptr<server::App> app;
  Error error;
  std::string url, admin;
  std::uint16_t port{0};
};

}  // namespace anchord::test
