#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "api/admin/access.hpp"
#include "api/kit/router.hpp"
#include "api/stream/hub.hpp"
#include "core/ports/access_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/token_store.hpp"
#include "server/runtime/worker_pool.hpp"
#include "server/storage/geopackage.hpp"
#include "server/storage/sqlite_database.hpp"
#include "tests/api/ports.hpp"

namespace anchord::test {

using Json = nlohmann::json;

/// The application over a real SQLite database in a temporary folder, without sockets.
class AppFixture : public ::testing::Test {
 protected:
  void SetUp() override {
    char path[] = "/tmp/anchord_api_XXXXXX";
    ASSERT_NE(mkdtemp(path), nullptr);
    dir_ = path;
    open();
  }
  void TearDown() override {
    close();
    std::filesystem::remove_all(dir_);
  }
  void open() {
    StorageOptions options;
    options.data_dir = dir_ / "data";
    options.reserve_bytes = 0;
    auto opened = open_database(options);
    ASSERT_TRUE(opened.has_value()) << opened.error().message;
    database_ = std::move(opened).value();
    access_ = std::make_unique<api::AccessService>(database_->stores(), clock_);
    ASSERT_TRUE(access_->load());
    api::Application::Deps deps{.stores = database_->stores(),
                                .work = {*live_, *joint_, at_once_, jobs_},
                                .clock = clock_,
                                .access = *access_,
                                .backups = no_backups_,
                                .devices = devices(),
                                .model_key = std::string(64, '7')};
    deps.build = {"0.2.0", "test", "", "", 1};
    deps.goal = goal_;
    deps.housekeeping_by_hand = true;
    deps.geopackage = geopackage;
    configure(deps);
    app_ = std::make_unique<StreamingApplication>(std::move(deps));
    app_->start();
  }
  /// What a fixture adds before the application is made.
  virtual void configure(api::Application::Deps&) {}
  virtual DeviceControl& devices() { return no_devices_; }
  void close() {
    app_.reset();
    access_.reset();
    database_.reset();
  }
  void restart() {
    close();
    open();
  }

  struct Call {
    std::string type{"application/json"};
    std::map<std::string, std::string> query{}, headers{};
    std::vector<api::Role> roles{api::Role::admin};
    std::string token{"tester"};
  };
  api::Response call(api::Method method, const std::string& path, const std::string& body,
                     const Call& options) {
    api::Request request;
    request.method = method;
    request.path = path;
    request.query = options.query;
    request.headers = options.headers;
    if (!body.empty() && !options.type.empty()) request.headers["content-type"] = options.type;
    request.body = body;
    request.principal = {options.token, options.token, options.roles};
    request.request_id = "test-1";
    request.remote = "127.0.0.1";
    return app_->router().handle(request);
  }
  api::Response get(const std::string& path, std::map<std::string, std::string> query = {}) {
    Call options;
    options.query = std::move(query);
    return call(api::Method::get, path, "", options);
  }
  api::Response post(const std::string& path, const std::string& body,
                     const std::string& type = "application/json",
                     std::map<std::string, std::string> query = {}) {
    Call options;
    options.type = type;
    options.query = std::move(query);
    return call(api::Method::post, path, body, options);
  }
  static Json json(const api::Response& response) { return Json::parse(response.body); }
  static std::string header(const api::Response& response, const std::string& name) {
    for (const auto& [key, value] : response.headers) {
      if (key == name) return value;
    }
    return {};
  }
  static std::string text(const api::Response& response) {
    if (!response.body_stream) return response.body;
    std::string all, part;
    while (!(part = response.body_stream()).empty()) all += part;
    return all;
  }
  /// A mission; the id.
  std::string mission(const std::string& frame = "wgs84") {
    const auto response = post("/api/v1/missions", R"({"name":"test flight","frame":")" + frame +
                                                       R"(","track_point":"tag_antenna"})");
    EXPECT_EQ(response.status, 201) << response.body;
    return json(response).value("id", "");
  }

  /// A stored calibration of anchors 0x6a2f and 0x6a3c, `finish` having made of each what the test needs; its
  /// id. Of this mission, else of a new one.
  std::string stored_calibration(const std::function<void(Estimate&)>& finish, std::string of = "") {
    if (of.empty()) of = mission();
    Calibration c;
    c.id.uuid = make_uuid_v7(clock_.now());
    c.missions = {MissionId{parse_uuid(of).value()}};
    c.origin = Wgs84{51.023, 3.713, 55};
    c.settings = {"{}"};
    c.created = clock_.now();
    for (const std::uint32_t id : {0x6a2fu, 0x6a3cu}) {
      Estimate e;
      e.anchor = {id};
      e.time = clock_.now();
      e.verdict = Verdict::ok;
      e.best.emplace();
      e.best->wgs84 = Wgs84{51.0231, 3.7131, 58.4};
      e.best->covariance_m2 = Eigen::Vector3d(4e-4, 4e-4, 1e-3).asDiagonal();
      e.h95_m = 0.05;
      e.v95_m = 0.06;
      e.n_used = 100;
      e.gates = {{"redundancy", 96.0, 30.0, true, ""}};
      finish(e);
      c.anchors.push_back(e);
    }
    EXPECT_TRUE(database_->stores().calibrations.insert(c).has_value());
    return to_string(c.id);
  }

  /// The system's, unless a test sets it: ahead by so much.
  struct SetClock final : Clock {
    UtcTime now() const override {
      return {SystemClock{}.now().ns + static_cast<std::int64_t>(ahead_s * 1e9)};
    }
    std::atomic<double> ahead_s{0};
  };
  SetClock clock_;
  std::filesystem::path dir_;
  std::unique_ptr<Database> database_;
  NoBackups no_backups_;
  NoDevices no_devices_;
  AccuracyGoal goal_{};
  /// The live path and the planner run where they are asked for, so that an answer has seen what came before.
  InlineExecutor at_once_;
  server::WorkerPool one_{"test-joint", 1, 1}, jobs_{"test-job", 5, 5};
  Executor *live_{&at_once_}, *joint_{&one_};
  std::unique_ptr<api::AccessService> access_;
  std::unique_ptr<StreamingApplication> app_;
};

}  // namespace anchord::test
