// Real flights, imported through REST into the running server, solved there, and compared with truth.
// The bar is the column "plain least squares" of the data sets' README: what a competent person gets in an
// afternoon.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "api/formats/flight_folder.hpp"
#include "api/wire/rows_json.hpp"
#include "core/geo/enu.hpp"
#include "server/http/http_client.hpp"
#include "tests/paths.hpp"

namespace anchord::rest_flights_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

fs::path shared() { return ANCHORD_SHARED_DATA; }

/// The real binary on a port of the system's choice, with an empty data folder.
class Server {
 public:
  Server() {
    char path[] = "/tmp/anchord_flights_XXXXXX";
    dir_ = mkdtemp(path);
    const std::string data = (dir_ / "data").string();
    std::vector<std::string> words{ANCHORD_BINARY, "serve", "--listen",   "127.0.0.1:0",
                                   "--auth",       "off",   "--data-dir", data};
    std::vector<char*> argv;
    for (auto& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    const std::string log = (dir_ / "log").string();
    posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
    posix_spawn(&pid_, ANCHORD_BINARY, &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (url_.empty() && std::chrono::steady_clock::now() < deadline) {
      std::ifstream file(dir_ / "data" / "address");
      std::getline(file, url_);
      if (url_.empty()) std::this_thread::yield();
    }
  }
  ~Server() {
    if (pid_ > 0) {
      ::kill(pid_, SIGTERM);
      ::waitpid(pid_, nullptr, 0);
    }
    fs::remove_all(dir_);
  }
  const std::string& url() const { return url_; }

 private:
  fs::path dir_;
  pid_t pid_{-1};
  std::string url_;
};

Json call(server::HttpClient& client, const std::string& method, const std::string& target,
          const std::string& body, const std::string& type, int expected) {
  const auto answer = client.call(method, target, body, type);
  if (!answer) {
    ADD_FAILURE() << target << ": " << answer.error().message;
    return {};
  }
  EXPECT_EQ(answer.value().status, expected) << target << ": " << answer.value().body.substr(0, 500);
  return Json::parse(answer.value().body, nullptr, false);
}

template <class Row, class Write>
std::pair<int, int> upload(server::HttpClient& client, const std::string& target,
                           const std::vector<Row>& rows, Write write) {
  int accepted = 0, rejected = 0;
  std::string body;
  const auto send = [&] {
    if (body.empty()) return;
    const Json answer = call(client, "POST", target, body, "application/x-ndjson", 200);
    accepted += answer.value("accepted", 0);
    rejected += answer.value("rejected", 0);
    body.clear();
  };
  for (const auto& row : rows) {
    body += write(row).dump() + '\n';
    if (body.size() > (4u << 20)) send();
  }
  send();
  return {accepted, rejected};
}

/// Imports one flight folder: the id of its mission.
std::string import_over_rest(server::HttpClient& client, const fs::path& folder) {
  const auto read = read_flight_folder(folder);
  if (!read) {
    ADD_FAILURE() << read.error().message;
    return {};
  }
  const FlightData& flight = read.value();
  static constexpr std::array k_points{"gnss_antenna", "body", "tag_antenna"};
  Json tags = Json::array();
  for (const auto& tag : flight.mission.tags) {
    const auto& arm = tag.lever_arm_body_m;
    tags.push_back({{"tag", to_string(tag.tag)},
                    {"antenna", tag.antenna},
                    {"lever_arm_body_m", {arm.x(), arm.y(), arm.z()}}});
  }
  const Json mission = call(client, "POST", "/api/v1/missions",
                            Json{{"name", folder.filename().string()},
                                 {"kit", flight.mission.kit},
                                 {"frame", flight.mission.frame == TrackFrame::wgs84 ? "wgs84" : "local"},
                                 {"track_point", k_points[static_cast<std::size_t>(flight.mission.point)]},
                                 {"tags", tags}}
                                .dump(),
                            "application/json", 201);
  const std::string id = mission.value("id", "");
  const auto without_mission = [](auto row) {
    row.erase("mission");  // given in the query
    return row;
  };
  const auto fixes = upload(client, "/api/v1/fixes?mission=" + id, flight.fixes, [&](const Fix& fix) {
    return without_mission(api::fix_json(fix, std::nullopt));
  });
  const auto ranges = upload(client, "/api/v1/ranges?mission=" + id, flight.ranges, [&](const Range& range) {
    return without_mission(api::range_json(range, std::nullopt));
  });
  std::printf("%s: %d fixes (%d refused), %d ranges (%d refused)\n", folder.filename().c_str(), fixes.first,
              fixes.second, ranges.first, ranges.second);
  return id;
}

/// The calibration of one mission as answered; `others`: flights of the same kit to learn bias and lag from.
Json solve_over_rest(server::HttpClient& client, const std::string& mission,
                     const std::vector<std::string>& others = {}) {
  Json request{{"missions", {mission}}};
  if (!others.empty()) request["learn_from"] = others;
  return call(client, "POST", "/api/v1/calibrations", request.dump(), "application/json", 201);
}

std::vector<std::map<std::string, std::string>> read_csv(const fs::path& path) {
  std::ifstream file(path);
  std::string line, cell;
  std::vector<std::string> header;
  std::vector<std::map<std::string, std::string>> rows;
  for (bool first = true; std::getline(file, line); first = false) {
    std::istringstream cells(line);
    std::map<std::string, std::string> row;
    for (std::size_t i = 0; std::getline(cells, cell, ','); ++i) {
      if (first)
        header.push_back(cell);
      else
        row[header.at(i)] = cell;
    }
    if (!row.empty()) rows.push_back(row);
  }
  return rows;
}

const Json* anchor_of(const Json& calibration, const std::string& id) {
  const auto network_id = parse_network_id(id);
  if (!calibration.contains("anchors") || !network_id) return nullptr;
  for (const auto& anchor : calibration["anchors"]) {
    if (anchor["network_id"] == to_string(network_id.value())) return &anchor;
  }
  return nullptr;
}

std::optional<Eigen::Vector3d> position(const Json* anchor) {
  if (anchor == nullptr || !(*anchor)["enu_m"].is_array()) return std::nullopt;
  return Eigen::Vector3d((*anchor)["enu_m"][0], (*anchor)["enu_m"][1], (*anchor)["enu_m"][2]);
}

struct Errors {
  double sum{0}, largest{0};
  int n{0}, inside{0};
  double mean() const { return n > 0 ? sum / n : NAN; }
};

/// One line of the table; the error that counts for the set goes to `errors`.
void judge(const std::string& flight, const std::string& id, const Json* anchor,
           const Eigen::Vector3d& truth_enu, bool horizontal_only, Errors& errors) {
  const auto at = position(anchor);
  if (!at) {
    std::printf("%-16s %-4s %8s %8s %18s %7s %s\n", flight.c_str(), id.c_str(), "-", "-", "-", "-",
                anchor == nullptr ? "not heard" : (*anchor)["verdict"].get<std::string>().c_str());
    return;
  }
  const Eigen::Vector3d error = *at - truth_enu;
  const double h = error.head<2>().norm(), d = error.norm();
  const auto& c = (*anchor)["accuracy"]["relative"]["cov_enu_m2"];
  Eigen::Matrix2d cov;
  cov << c[0].get<double>(), c[1].get<double>(), c[1].get<double>(), c[3].get<double>();
  const bool inside = error.head<2>().dot(cov.inverse() * error.head<2>()) <=
                      5.991;  // 95 % of chi2 with 2 degrees of freedom
  const double h95 = (*anchor)["accuracy"]["relative"]["h95_m"],
               v95 = (*anchor)["accuracy"]["relative"]["v95_m"];
  char region[32];
  std::snprintf(region, sizeof region, "h %.2f v %.2f", h95, v95);
  char third[16] = "-";
  if (!horizontal_only) std::snprintf(third, sizeof third, "%.3f", d);
  std::printf("%-16s %-4s %8.3f %8s %18s %7s %s\n", flight.c_str(), id.c_str(), h, third, region,
              inside ? "inside" : "OUTSIDE", (*anchor)["verdict"].get<std::string>().c_str());
  const double counted = horizontal_only ? h : d;
  errors.sum += counted;
  errors.largest = std::max(errors.largest, counted);
  ++errors.n;
  errors.inside += inside ? 1 : 0;
}

void header() {
  std::printf("%-16s %-4s %8s %8s %18s %7s %s\n", "flight", "anc", "horiz m", "3D m", "claimed 95 % m", "",
              "verdict");
}

class RestFlights : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(shared()))
      GTEST_SKIP() << "SKIPPED: no real data at " << shared() << "; this proof did not run";
    server_ = std::make_unique<Server>();
    ASSERT_FALSE(server_->url().empty()) << "the server did not come up";
    auto client = server::HttpClient::to(server_->url(), std::chrono::seconds(240));
    ASSERT_TRUE(client.has_value()) << client.error().message;
    client_ = std::make_unique<server::HttpClient>(std::move(client).value());
    client_->set_header("Prefer", "wait=200");
  }
  std::vector<fs::path> flights(const std::string& set) {
    std::vector<fs::path> out;
    for (const auto& entry : fs::directory_iterator(shared() / set)) {
      if (fs::exists(entry.path() / "flight.json")) out.push_back(entry.path());
    }
    std::sort(out.begin(), out.end());
    return out;
  }
  Errors local_set(const fs::path& folder, const std::string& mission,
                   const std::vector<std::string>& others = {}) {
    Errors errors;
    const Json calibration = solve_over_rest(*client_, mission, others);
    header();
    for (const auto& row : read_csv(folder / "anchors_truth.csv")) {
      judge(folder.filename(), row.at("anchor_id"), anchor_of(calibration, row.at("anchor_id")),
            {std::stod(row.at("x_m")), std::stod(row.at("y_m")), std::stod(row.at("z_m"))}, false, errors);
    }
    last_ = calibration;
    return errors;
  }
  std::unique_ptr<Server> server_;
  std::unique_ptr<server::HttpClient> client_;
  Json last_;
};

TEST_F(RestFlights, OutdoorRtkReachesPlainLeastSquaresHorizontally) {
  Errors errors;
  for (const auto& folder : flights("outdoor-rtk")) {
    const Json calibration = solve_over_rest(*client_, import_over_rest(*client_, folder));
    ASSERT_TRUE(calibration.contains("origin") && calibration["origin"].is_object());
    const EnuFrame frame(
        {calibration["origin"]["lat"], calibration["origin"]["lon"], calibration["origin"]["h_m"]});
    header();
    for (const auto& row : read_csv(folder / "anchors_truth.csv")) {
      // The truth has no ellipsoidal height: horizontal only.
      const Enu truth = frame.enu_from_wgs84(
          {std::stod(row.at("lat_deg")), std::stod(row.at("lon_deg")), calibration["origin"]["h_m"]});
      judge(folder.filename(), row.at("anchor_id"), anchor_of(calibration, row.at("anchor_id")), truth.m,
            true, errors);
    }
  }
  std::printf("outdoor-rtk: %d anchors, mean %.3f m, max %.3f m, %d inside; plain 0.107\n", errors.n,
              errors.mean(), errors.largest, errors.inside);
  EXPECT_EQ(errors.n, 16);
  EXPECT_LE(errors.mean(), 0.107);
}

TEST_F(RestFlights, InrolMocapReachesPlainLeastSquaresIn3d) {
  Errors all;
  const auto folders = flights("inrol-mocap");
  std::vector<std::string> missions;
  for (const auto& folder : folders) missions.push_back(import_over_rest(*client_, folder));
  for (std::size_t i = 0; i < folders.size(); ++i) {
    std::vector<std::string> others = missions;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Errors errors = local_set(folders[i], missions[i], others);
    all.sum += errors.sum;
    all.n += errors.n;
    all.inside += errors.inside;
    all.largest = std::max(all.largest, errors.largest);
  }
  std::printf("inrol-mocap: %d anchors, mean %.3f m, max %.3f m, %d inside; plain 0.145\n", all.n, all.mean(),
              all.largest, all.inside);
  EXPECT_EQ(all.n, 24);
  EXPECT_LE(all.mean(), 0.145);
}

TEST_F(RestFlights, RcvDroneReachesPlainLeastSquaresAndFlagsTheLineFlight) {
  const Errors one =
      local_set(shared() / "rcv-drone" / "seq1", import_over_rest(*client_, shared() / "rcv-drone" / "seq1"));
  const Errors three =
      local_set(shared() / "rcv-drone" / "seq3", import_over_rest(*client_, shared() / "rcv-drone" / "seq3"));
  const Errors line =
      local_set(shared() / "rcv-drone" / "seq5", import_over_rest(*client_, shared() / "rcv-drone" / "seq5"));
  std::printf(
      "rcv-drone: seq1 %.3f m (plain 0.449), seq3 %.3f m (plain 0.242), seq5 %.3f m (must be flagged)\n",
      one.mean(), three.mean(), line.mean());
  EXPECT_LE(one.mean(), 0.449);
  EXPECT_LE(three.mean(), 0.242);
  for (const auto& anchor : last_["anchors"])
    EXPECT_NE(anchor["verdict"], "ok") << "a line flight determines no anchor: " << anchor["network_id"];
}

TEST_F(RestFlights, ViralDroneReachesPlainLeastSquaresBetweenAnchors) {
  // anchor_to_anchor_uwb.csv of the set: 100-101, 100-102, 101-102, metres, measured by the radios.
  const std::map<std::string, std::array<double, 3>> k_measured{
      {"eee", {41.749, 27.176, 22.15}}, {"nya", {14.727, 13.088, 15.077}}, {"sbs", {31.381, 24.696, 26.038}}};
  const auto authors = read_csv(shared() / "viral-drone" / "anchors_authors_estimate.csv");
  Errors between, against;
  for (const auto& folder : flights("viral-drone")) {
    const Json calibration = solve_over_rest(*client_, import_over_rest(*client_, folder));
    const std::string name = folder.filename(), place = name.substr(0, 3);
    std::array<std::optional<Eigen::Vector3d>, 3> at;
    for (std::size_t i = 0; i < 3; ++i) at[i] = position(anchor_of(calibration, std::to_string(100 + i)));
    constexpr std::pair<int, int> k_pairs[]{{0, 1}, {0, 2}, {1, 2}};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto &a = at[static_cast<std::size_t>(k_pairs[k].first)],
                 &b = at[static_cast<std::size_t>(k_pairs[k].second)];
      if (!a || !b) continue;
      between.sum += std::abs((*a - *b).norm() - k_measured.at(place)[k]);
      ++between.n;
    }
    if (name.substr(4) != "01") continue;  // the authors' numbers are in the frame of flight 01
    header();
    for (const auto& row : authors) {
      if (row.at("place") != place) continue;
      judge(name, row.at("anchor_id"), anchor_of(calibration, row.at("anchor_id")),
            {std::stod(row.at("x_m")), std::stod(row.at("y_m")), std::stod(row.at("z_m"))}, false, against);
    }
  }
  std::printf("viral-drone: between anchors %.3f m (plain 2.05), against the authors %.3f m (plain 1.97)\n",
              between.mean(), against.mean());
  EXPECT_EQ(between.n, 27);
  EXPECT_LE(between.mean(), 2.05);
  EXPECT_LE(against.mean(), 1.97);
}

}  // namespace
}  // namespace anchord::rest_flights_test
