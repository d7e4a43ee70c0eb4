#pragma once

#include <sqlite3.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <sstream>

#include "api/formats/bundle.hpp"
#include "api/formats/handover.hpp"
#include "app_fixture.hpp"
#include "core/base/sha256.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/event_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"
#include "tests/api/zip_builder.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::test {
using api::Method;
using Entries = std::vector<std::pair<std::string, std::string>>;

/// A server beside that of the test, with a database of its own.
class OtherServer final : public AppFixture {
 public:
  OtherServer() { SetUp(); }
  ~OtherServer() override { TearDown(); }
  void TestBody() override {}
  using AppFixture::get;
  api::Response take(const std::string& bytes) { return post("/api/v1/bundles", bytes, "application/zip"); }
  Stores stores() { return database_->stores(); }
  api::Response solve(const std::string& mission) {
    Call options;
    options.headers["prefer"] = "wait=120";
    return call(Method::post, "/api/v1/calibrations", R"({"missions":[")" + mission + "\"]}", options);
  }
};

/// Every row of a flight.
struct Rows final : BundleSink {
  std::map<std::string, std::vector<BundleRow>> tables;
  std::vector<BundleRow>* now{nullptr};
  Result<void> begin(const BundleTable& table) override {
    now = &tables[table.name];
    return boost::outcome_v2::success();
  }
  Result<void> row(const BundleRow& row) override {
    now->push_back(row);
    return boost::outcome_v2::success();
  }
};
inline Rows rows_of(Stores stores, const MissionId& mission) {
  Rows out;
  const auto written = stores.bundles.write_out(mission, out);
  EXPECT_TRUE(written) << written.error().message;
  return out;
}

class Bundles : public AppFixture {
 protected:
  /// A flight of a site: finished, rows taken out and back, calibrated, its kit learned, published.
  void SetUp() override {
    AppFixture::SetUp();
    testing::MadeFlight made;
    made.frame = TrackFrame::wgs84;
    auto flight = testing::make_flight(made);
    Site site;
    site.id.uuid = make_uuid_v7(clock_.now());
    site.name = "Hall \xC3\xA9";
    site.origin = made.origin;
    site.created = clock_.now();
    Stores s = database_->stores();
    ASSERT_TRUE(s.sites.insert(site));
    Mission mission = flight.mission;
    id_ = MissionId{make_uuid_v7(clock_.now())};
    mission.id = id_;
    mission.site = site.id;
    mission.name = "north side";
    mission.kit = "kit-1";
    mission.created = clock_.now();
    ASSERT_TRUE(s.missions.insert(mission));
    for (auto& fix : flight.fixes) fix.mission = id_;
    for (auto& range : flight.ranges) range.mission = id_;
    flight.ranges[5].cir.emplace();
    flight.ranges[5].cir->re_im = {0, 1, -1, 32767, -32768, 7};
    flight.ranges[5].cir->first_path_idx = 0.25;
    n_ranges_ = flight.ranges.size();
    ASSERT_TRUE(s.measurements.append_fixes(flight.fixes, true));
    ASSERT_TRUE(s.measurements.append_ranges(flight.ranges, true));
    const auto devices = s.measurements.devices(id_);
    for (const auto& device : devices.value()) {
      if (device.kind != DeviceSeen::Kind::anchor) continue;
      ASSERT_TRUE(s.anchors.find_or_create(device.network_id, clock_.now()));
    }
    Exclusion exclusion;
    exclusion.id.uuid = make_uuid_v7(clock_.now());
    exclusion.mission = id_;
    exclusion.reason = "a crane";
    exclusion.by = "tester";
    exclusion.created = clock_.now();
    ASSERT_TRUE(s.exclusions.insert(exclusion, {7, 8, 9}));
    ASSERT_TRUE(s.missions.finish(id_, clock_.now()));
    calibration_ = solved(*this, to_string(id_));
    const auto solved = s.calibrations.calibration(calibration_).value();
    ASSERT_TRUE(
        s.revisions.publish(calibration_, {solved.anchors.front().anchor}, "tester", "", clock_.now()));
  }
  template <class Server>
  static CalibrationId solved(Server& server, const std::string& mission) {
    const auto done = solve_on(server, mission);
    EXPECT_EQ(done.status, 201) << done.body;
    return CalibrationId{parse_uuid(json(done).value("id", "")).value()};
  }
  static api::Response solve_on(OtherServer& server, const std::string& mission) {
    return server.solve(mission);
  }
  static api::Response solve_on(Bundles& server, const std::string& mission) {
    Call options;
    options.headers["prefer"] = "wait=120";
    return server.call(Method::post, "/api/v1/calibrations", R"({"missions":[")" + mission + "\"]}", options);
  }
  void configure(api::Application::Deps& deps) override {
    deps.spool_dir = dir_ / "spool";
    deps.print_pdf = [this](const std::filesystem::path& html, const std::filesystem::path& pdf) {
      if (!prints_) return Result<void>(make_error(Errc::unsupported, "nothing prints here"));
      std::ofstream(pdf) << "%PDF-1.7 of " << std::filesystem::file_size(html);
      return Result<void>(boost::outcome_v2::success());
    };
  }
  bool prints_{false};
  static Json json_of(const std::string& text) { return Json::parse(text); }
  std::string path(const char* tail) const { return "/api/v1/missions/" + to_string(id_) + tail; }
  std::string bundle() {
    const auto answer = get(path("/bundle"));
    EXPECT_EQ(answer.status, 200) << answer.body;
    return text(answer);
  }
  Entries entries_of(const std::string& bytes) const {
    const auto file = dir_ / "looked at.zip";
    std::ofstream(file, std::ios::binary) << bytes;
    const auto zip = api::ZipReader::open(file);
    EXPECT_TRUE(zip) << zip.error().message;
    Entries out;
    for (const auto& entry : zip.value().entries())
      out.emplace_back(entry.name, zip.value().text(entry.name, std::uint64_t{1} << 30).value());
    return out;
  }
  static std::string zip_of(const Entries& entries) {
    ZipBuilder zip;
    for (const auto& [name, content] : entries) zip.add({name, content, true});
    return zip.bytes();
  }
  static std::string& content(Entries& entries, const std::string& name) {
    const auto at =
        std::find_if(entries.begin(), entries.end(), [&](const auto& e) { return e.first == name; });
    EXPECT_NE(at, entries.end()) << name;
    return at->second;
  }
  /// As a forger would: the manifest says again what the entries are.
  static void say_again(Entries& entries) {
    auto manifest = api::read_bundle_manifest(content(entries, "manifest.json")).value();
    for (auto& entry : manifest.entries) {
      const std::string& text = content(entries, entry.name);
      Sha256 sum;
      sum.add(text);
      entry.bytes = text.size();
      entry.sha256_hex = sum.hex();
    }
    content(entries, "manifest.json") = api::write_bundle_manifest(manifest);
  }
  /// A row of a table changed, and the bundle made good again.
  std::string forged(const std::string& table, const std::string& from, const std::string& to) {
    auto entries = entries_of(bundle());
    std::string& text = content(entries, "tables/" + table + ".ndjson");
    const auto at = text.find(from, text.find('\n'));
    EXPECT_NE(at, std::string::npos) << from << " in " << text.substr(0, 500);
    text.replace(at, from.size(), to);
    say_again(entries);
    return zip_of(entries);
  }
  /// The bundle with the value (JSON) of a column in a row of a table, counted from 0, made good again.
  std::string with_cell(const std::string& table, const std::string& column, const Json& value,
                        std::size_t row = 0) {
    auto entries = entries_of(bundle());
    std::istringstream lines(content(entries, "tables/" + table + ".ndjson"));
    std::string head, line, out;
    std::getline(lines, head);
    const auto columns = Json::parse(head);
    const auto at = std::ranges::find(columns, Json(column)) - columns.begin();
    EXPECT_LT(at, static_cast<std::ptrdiff_t>(columns.size())) << column;
    for (std::size_t i = 0; std::getline(lines, line); ++i) {
      auto cells = Json::parse(line);
      if (i == row) cells[static_cast<std::size_t>(at)] = value;
      out += cells.dump() + '\n';
    }
    content(entries, "tables/" + table + ".ndjson") = head + '\n' + out;
    say_again(entries);
    return zip_of(entries);
  }
  static void expect_nothing(OtherServer& server) {
    EXPECT_TRUE(json(server.get("/api/v1/missions"))["items"].empty());
    EXPECT_TRUE(json(server.get("/api/v1/sites"))["items"].empty());
  }

  MissionId id_{};
  CalibrationId calibration_{};
  std::size_t n_ranges_{};
};

}  // namespace anchord::test
