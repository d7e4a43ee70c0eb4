// Secrets of devices come over REST and never go back; paths of the server never come.
#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <set>

#include "tests/server/app/app_fixture.hpp"

namespace anchord::test::device_secrets_test {
namespace {

using Json = nlohmann::json;

/// A caster that only reads: what a client sends to it when it connects.
class Caster {
 public:
  Caster() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&at), sizeof at), 0);
    EXPECT_EQ(::listen(socket_, 8), 0);
    socklen_t size = sizeof at;
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&at), &size);
    address = "tcp://127.0.0.1:" + std::to_string(ntohs(at.sin_port));
  }
  ~Caster() { ::close(socket_); }
  Caster(const Caster&) = delete;
  Caster& operator=(const Caster&) = delete;

  /// The next request, or empty when none comes in time.
  std::string request(std::chrono::milliseconds time = std::chrono::seconds(20)) const {
    pollfd waiting{socket_, POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(time.count())) <= 0) return {};
    const int peer = ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC);
    std::string text;
    char bytes[2000];
    while (text.find("\r\n\r\n") == std::string::npos) {
      const ssize_t n = ::recv(peer, bytes, sizeof bytes, 0);
      if (n <= 0) break;
      text.append(bytes, static_cast<std::size_t>(n));
    }
    ::close(peer);
    return text;
  }
  std::string address;

 private:
  int socket_;
};

Json caster_device(const std::string& address, const Json& options) {
  Json all{{"mount", "BASE"}, {"user", "me"}};
  all.merge_patch(options);
  return {{"kind", "ntrip"}, {"name", "caster"}, {"address", address}, {"options", all}};
}

std::string all_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

unsigned mode_of(const std::filesystem::path& file) {
  struct stat info {};
  return ::stat(file.c_str(), &info) == 0 ? info.st_mode & 0777u : 0;
}

// An operator named a file (the admin token, say) and an address of his own: its first line came there.
TEST(DeviceSecrets, NoFileOfTheServerIsReadBecauseItWasNamedOverRest) {
  Caster caster;
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto pilot = server.bearer(server.token(R"(["operator"])"));
  const std::string file = (server.folder / "data" / server::k_admin_token_file).string();
  const auto body = caster_device(caster.address, {{"password_file", file}});
  const auto refused = server.call("POST", "/api/v1/devices", body.dump(), pilot);
  EXPECT_EQ(refused.status, 422) << refused.body;
  EXPECT_NE(refused.body.find("/options/password_file"), std::string::npos) << refused.body;
  EXPECT_NE(refused.body.find("options.password"), std::string::npos) << "and what to do instead";
  const auto made =
      server.call("POST", "/api/v1/devices", caster_device(caster.address, Json::object()).dump(), pilot);
  ASSERT_EQ(made.status, 201) << made.body;
  auto change = pilot;
  change["If-Match"] = "*";
  const auto patched = server.call("PATCH", made.headers.at("location"),
                                   Json{{"options", {{"password_file", file}}}}.dump(), change);
  EXPECT_EQ(patched.status, 422) << patched.body;
  const auto asked = caster.request();
  EXPECT_NE(asked.find("Authorization: Basic bWU6\r\n"), std::string::npos)
      << "a user without a password: " << asked;
}

TEST(DeviceSecrets, APasswordGoesToTheCasterAndComesBackNowhere) {
  Caster caster;
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto pilot = server.bearer(server.token(R"(["operator"])"));
  const auto made = server.call("POST", "/api/v1/devices",
                                caster_device(caster.address, {{"password", "secret"}}).dump(), pilot);
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_NE(caster.request().find("Authorization: Basic bWU6c2VjcmV0\r\n"), std::string::npos);
  const std::string path = made.headers.at("location");
  const auto shown = server.call("GET", path, {}, pilot).body;
  EXPECT_TRUE(Json::parse(shown)["options"].value("password_set", false)) << shown;
  const auto data = server.folder / "data";
  const auto secret = data / "secrets" / path.substr(path.rfind('/') + 1);
  EXPECT_EQ(all_of(secret), "secret\n");
  EXPECT_EQ(mode_of(secret), 0600u);
  EXPECT_EQ(mode_of(data / "secrets"), 0700u);
  for (const auto& text : {made.body, shown, all_of(data / "devices.json"),
                           server.call("GET", "/api/v1/audit", {}, server.bearer(server.admin)).body})
    EXPECT_EQ(text.find("secret\""), std::string::npos) << text;
  auto change = pilot;
  change["If-Match"] = "*";
  // To another address it would be given to whoever listens there.
  Caster stranger;
  const auto moved = server.call("PATCH", path, Json{{"address", stranger.address}}.dump(), change);
  EXPECT_EQ(moved.status, 422) << moved.body;
  EXPECT_NE(moved.body.find("send the password again"), std::string::npos) << moved.body;
  const auto renamed = server.call("PATCH", path, R"({"name":"base"})", change);
  EXPECT_EQ(renamed.status, 200) << renamed.body;
  EXPECT_NE(caster.request().find("bWU6c2VjcmV0"), std::string::npos) << "it is kept";
  const auto with_it =
      server.call("PATCH", path,
                  Json{{"address", stranger.address}, {"options", {{"password", "other"}}}}.dump(), change);
  EXPECT_EQ(with_it.status, 200) << with_it.body;
  EXPECT_NE(stranger.request().find("Authorization: Basic bWU6b3RoZXI=\r\n"), std::string::npos);
  const auto forgotten =
      server.call("PATCH", path, Json{{"options", {{"password", nullptr}}}}.dump(), change);
  EXPECT_EQ(forgotten.status, 200) << forgotten.body;
  EXPECT_FALSE(Json::parse(forgotten.body)["options"].contains("password_set")) << forgotten.body;
  EXPECT_FALSE(std::filesystem::exists(secret));
  for (const char* bad : {R"({"options":{"password":7}})", R"({"options":{"password":"a\r\nX: y"}})"})
    EXPECT_EQ(server.call("PATCH", path, bad, change).status, 422) << bad;
}

TEST(DeviceSecrets, AKeptDeviceThatNamesAFileIsNotStartedUntilItsPasswordIsSent) {
  Caster caster;
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto data = server.folder / "data";
  const std::string admin = server.admin;
  const std::string id = "0197a3c2-5d10-7b1e-9c55-0a1b2c3d4e5f";
  server.app.reset();
  Json device =
      caster_device(caster.address, {{"password_file", (data / server::k_admin_token_file).string()}});
  device["id"] = id;
  device["enabled"] = true;
  device["version"] = 3;
  std::ofstream(data / "devices.json") << Json{{"schema", "anchord.devices/1"}, {"devices", {device}}}.dump();
  const auto config =
      server::load_config({{"listen", "127.0.0.1:0"}, {"data_dir", data.string()}}, std::nullopt, {});
  auto again = server::App::start(config.value());
  ASSERT_TRUE(again) << again.error().message;
  server.app = std::move(again).value();
  server.url = server.app->urls().front();
  const auto shown = server.call("GET", "/api/v1/devices/" + id, {}, server.bearer(admin));
  ASSERT_EQ(shown.status, 200) << shown.body;
  EXPECT_EQ(Json::parse(shown.body)["state"], "off") << shown.body;
  EXPECT_NE(shown.body.find("password_file is no longer used"), std::string::npos) << shown.body;
  auto change = server.bearer(admin);
  change["If-Match"] = "*";
  EXPECT_EQ(
      server.call("PATCH", "/api/v1/devices/" + id, R"({"options":{"password":"secret"}})", change).status,
      200);
  EXPECT_NE(caster.request().find("Authorization: Basic bWU6c2VjcmV0\r\n"), std::string::npos)
      << "the first it hears is the new password";
}

/// Names of all properties below requestBody schemas, with their references followed.
void collect(const Json& contract, const Json& schema, std::set<std::string>& names, int depth = 0) {
  if (depth > 12) return;
  if (schema.is_array()) {
    for (const auto& one : schema) collect(contract, one, names, depth + 1);
    return;
  }
  if (!schema.is_object()) return;
  if (const auto ref = schema.find("$ref"); ref != schema.end() && ref->is_string()) {
    return collect(contract, contract.at(Json::json_pointer(ref->get<std::string>().substr(1))), names,
                   depth + 1);
  }
  if (const auto properties = schema.find("properties"); properties != schema.end()) {
    for (const auto& [name, inner] : properties->items()) {
      names.insert(name);
      collect(contract, inner, names, depth + 1);
    }
  }
  for (const char* key : {"items", "allOf", "oneOf", "anyOf", "additionalProperties", "schema"}) {
    if (const auto inner = schema.find(key); inner != schema.end())
      collect(contract, *inner, names, depth + 1);
  }
}

// The rule: what comes over REST names no file of the server and no address that it opens, with these
// exceptions, each decided: an address of a device (a port that is a terminal line, or a socket) is what
// setting one up means.
TEST(RequestFields, NameNoPathAndNoAddressOfTheServer) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto contract = Json::parse(server.call("GET", "/api/v1/openapi.json").body);
  std::set<std::string> names;
  for (const auto& [path, operations] : contract["paths"].items()) {
    for (const auto& [method, operation] : operations.items()) {
      if (!operation.is_object() || !operation.contains("requestBody")) continue;
      const auto& body = operation["requestBody"];
      const Json& whole = body.contains("$ref")
                              ? contract.at(Json::json_pointer(body["$ref"].get<std::string>().substr(1)))
                              : body;
      for (const auto& [type, media] : whole["content"].items()) collect(contract, media, names);
    }
  }
  EXPECT_GT(names.size(), 50u) << "the walk found the fields";
  // Decided: where a device is reached; a sample of an impulse response; an accuracy profile of a kit; where
  // a webhook is sent, which is no address of this machine or its network (web_post); the six numbers of a
  // world file, themselves.
  for (const char* decided : {"address", "first_path_idx", "profile", "url", "world_file"})
    names.erase(decided);
  std::set<std::string> suspects;
  for (const auto& name : names) {
    for (const char* word :
         {"path", "file", "dir", "folder", "url", "uri", "address", "host", "href", "command"}) {
      if (name.find(word) != std::string::npos) suspects.insert(name);
    }
  }
  std::string list;
  for (const auto& name : suspects) list += name + ' ';
  EXPECT_TRUE(suspects.empty()) << "decide, and say so here: " << list;
}

TEST(DeviceAddresses, OpenNothingThatIsNoTerminalLine) {
  AppFixture server(Settings{{"rate.burst", "1000"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto pilot = server.bearer(server.token(R"(["operator"])"));
  const std::string file = (server.folder / "data" / "anchord.db").string();
  for (const auto& address :
       {"serial:" + file, std::string("serial:/dev/null"), std::string("serial:/dev/zero"),
        std::string("file:///etc/passwd"), std::string("http://127.0.0.1/")}) {
    const auto made = server.call("POST", "/api/v1/devices",
                                  Json{{"kind", "gnss"}, {"name", "x"}, {"address", address}}.dump(), pilot);
    if (made.status != 201) {
      EXPECT_EQ(made.status, 422) << address << made.body;
      continue;
    }
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    std::string shown;
    do {
      shown = server.call("GET", made.headers.at("location"), {}, pilot).body;
    } while (Json::parse(shown)["reason"].is_null() && std::chrono::steady_clock::now() < end);
    EXPECT_NE(shown.find("this is not a serial port"), std::string::npos) << address << " " << shown;
  }
}

}  // namespace
}  // namespace anchord::test::device_secrets_test
