#pragma once

#include <atomic>
#include <cmath>
#include <mutex>

#include "app_fixture.hpp"
#include "core/base/steady.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/mission_bin.hpp"

namespace anchord::test {

struct HandSteady final : SteadyClock {
  SteadyTime now() const override { return {1'000'000'000 + static_cast<std::int64_t>(*seconds * 1e9)}; }
  const std::atomic<double>* seconds{nullptr};
};

/// Devices of which only the stream matters: whose rows they are.
class OneStream final : public NoDevices {
 public:
  std::vector<DeviceReport> devices() override {
    DeviceReport rover;
    rover.config.name = "rover";
    rover.config.id = Uuid{{1}};
    return {rover};
  }
  Result<DeviceReport> device(const Uuid& id) override {
    auto rover = devices().front();
    rover.config.enabled = enabled;
    if (id != rover.config.id || removed) return none();
    return rover;
  }
  Result<void> remove(const Uuid&, std::uint64_t) override {
    removed = true;
    return boost::outcome_v2::success();
  }
  void record_into(const std::optional<MissionId>& mission) override {
    const std::scoped_lock lock(mutex_);
    into_ = mission;
  }
  std::optional<MissionId> recording_into() override {
    const std::scoped_lock lock(mutex_);
    return into_;
  }

  bool enabled{true}, removed{false};

 private:
  std::mutex mutex_;
  std::optional<MissionId> into_;
};

/// The application with devices, a pilot's flight (no aircraft to command) and clocks of its own.
class KeptFixture : public AppFixture {
 protected:
  DeviceControl& devices() override { return devices_; }
  void configure(api::Application::Deps& deps) override {
    steady_.seconds = &now_s_;
    deps.steady = &steady_;
    deps.flight_clock = [this] { return now_s_.load(); };
  }
  using Headers = std::map<std::string, std::string>;
  api::Response ask(api::Method method, const std::string& path, const std::string& body = "",
                    std::vector<api::Role> roles = {api::Role::admin}, Headers headers = {},
                    std::map<std::string, std::string> query = {}) {
    Call options;
    options.roles = std::move(roles);
    options.headers = std::move(headers);
    options.query = std::move(query);
    return call(method, path, body, options);
  }
  static std::string path(const std::string& id, const std::string& more = "") {
    return "/api/v1/missions/" + id + more;
  }
  std::string etag(const std::string& id) { return header(get(path(id)), "ETag"); }
  Json make(const std::string& name, const std::string& more = "") {
    const auto made =
        post("/api/v1/missions",
             R"({"name":")" + name + R"(","frame":"wgs84","track_point":"tag_antenna")" + more + '}');
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made);
  }
  std::string make_id(const std::string& name) { return make(name)["id"]; }
  std::string finished(const std::string& name) {
    const auto id = make_id(name);
    finish(id);
    return id;
  }
  void finish(const std::string& id, const std::string& lease = "") {
    const auto done = post(path(id, "/actions"), R"({"action":"finish","lease":")" + lease + "\"}");
    EXPECT_EQ(done.status, 200) << done.body;
  }
  std::string lease(const std::string& id, std::vector<api::Role> roles = {api::Role::admin}) {
    const auto taken =
        ask(api::Method::post, path(id, "/control"), R"({"action":"take","force":true})", roles);
    EXPECT_EQ(taken.status, 200) << taken.body;
    return json(taken).value("lease", "");
  }
  api::Response remove(const std::string& id, std::vector<api::Role> roles = {api::Role::admin},
                       Headers headers = {}) {
    if (headers.count("if-match") == 0) headers["if-match"] = etag(id);
    return ask(api::Method::del, path(id), "", std::move(roles), std::move(headers));
  }
  void ranges(const std::string& id, int n) {
    std::string rows;
    for (int i = 0; i < n; ++i)
      rows += R"({"t_us":)" + std::to_string(1'777'889'472'000'000 + i * 10'000) +
              R"(,"tag":"0x6e01","anchor":"0x6a2f","distance_m":7.4})" + "\n";
    EXPECT_EQ(post("/api/v1/ranges", rows, "application/x-ndjson", {{"mission", id}}).status, 200);
  }
  std::vector<std::string> codes(const std::string& id) {
    std::vector<std::string> out;
    const Json events = json(get(path(id, "/events")));
    for (const auto& event : events["items"]) out.push_back(event.value("code", ""));
    return out;
  }
  /// The aircraft at this height for n tenths of a second.
  void fix_at(const std::string& id, int n, double height_m) {
    for (int i = 0; i < n; ++i) {
      now_s_ = now_s_ + 0.1;
      char row[240];
      std::snprintf(row, sizeof row,
                    R"({"t_us":%lld,"lon":3.7129716,"lat":51.0230191,"h_m":%.1f,"fix":"fixed",)"
                    R"("sigma_m":[0.01,0.01,0.02],"correction_age_s":0.8})"
                    "\n",
                    1'777'889'472'000'000LL + std::llround(now_s_ * 1e6), height_m);
      EXPECT_EQ(post("/api/v1/fixes", row, "application/x-ndjson", {{"mission", id}}).status, 200);
      app_->fly();
    }
  }
  /// A mission in the air by hand, and its lease; more of its plan and of the settings in it.
  std::string fly(const std::string& id, const std::string& of_plan = "", const std::string& setting = "") {
    const auto plan = json(post("/api/v1/plans", R"({"name":"Hall","building_height_m":8,)" + of_plan + R"(
      "origin":{"lon":3.7131,"lat":51.0231,"h_m":55.5},
      "outline":{"type":"Polygon","coordinates":[[[3.7131,51.0231],[3.7135275,51.0231],[3.7135275,51.0232799],[3.7131,51.0232799]]]},
      "settings":{)" + setting + R"("keep_out_m":4,"max_height_m":20},
      "waypoints":[{"lon":3.7130,"lat":51.02305,"height_above_ground_m":4},
                   {"lon":3.71362,"lat":51.02305,"height_above_ground_m":9}]})"));
    plan_ = plan["id"];
    fix_at(id, 120, 55.5);
    for (const char* item : {"props", "airspace", "people", "pilot", "tag", "disk", "battery"})
      post(path(id, "/checklist/") + item, R"({"reason":"looked at it"})");
    const std::string key = lease(id);
    const auto started =
        post(path(id, "/actions"), R"({"action":"start","lease":")" + key + R"(","plan":")" + plan_ + "\"}");
    EXPECT_EQ(started.status, 202) << started.body;
    return key;
  }

  std::atomic<double> now_s_{0};
  HandSteady steady_;
  OneStream devices_;
  std::string plan_;
};

}  // namespace anchord::test
