// The listing for STAR*NET: its lines, what is refused, and an adjustment of it by an own reader of the
// format.
#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cstdio>
#include <sstream>

#include "api/formats/starnet.hpp"
#include "app_fixture.hpp"
#include "core/ports/calibration_store.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::test::starnet_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr NetworkId k_anchor{0x6a2f};

/// A range of 3-4-0: the tag at (3, 4, 8), the anchor at (0, 0, 8).
RangeResidual range_of(double corrected_m, double weight) {
  RangeResidual r;
  r.time = UtcTime::from_us(1'777'888'800'000'000);
  r.tag_m = {3, 4, 8};
  r.distance_m = corrected_m + 0.08;
  r.corrected_m = corrected_m;
  r.residual_m = corrected_m - 5.0;
  r.sigma_m = 0.05;
  r.standardised = r.residual_m / 0.05;
  r.weight = weight;
  return r;
}

/// One flight and one anchor at (0, 0, 8), with these ranges.
struct Made {
  Calibration calibration;
  Evidence evidence;
  explicit Made(const std::vector<RangeResidual>& rows) {
    calibration.origin = Wgs84{51.0231, 3.7131, 55.5};
    Estimate estimate;
    estimate.anchor = k_anchor;
    estimate.verdict = Verdict::ok;
    estimate.best.emplace();
    estimate.best->position.m = {0, 0, 8};
    estimate.best->covariance_m2 = Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal();
    estimate.n_used = 7;
    calibration.anchors = {estimate};
    evidence.flights.emplace_back();
    evidence.flights[0].name = "flight 1";
    evidence.flights[0].residuals[k_anchor] = rows;
  }
  std::string listing(const StarnetOptions& options = {"anchord", {{k_anchor, "Hal 'A', é"}}}) const {
    const auto made = starnet_listing(calibration, evidence, options);
    EXPECT_TRUE(made.has_value());
    return made ? made.value() : std::string();
  }
};

TEST(StarnetListing, HasFixedPlacesFreeAnchorsAndDistances) {
  const auto text = Made({range_of(5.02, 1.0)}).listing();
  EXPECT_THAT(text, HasSubstr("\r\n.3D\r\n.UNITS Meters\r\n.ORDER NE\r\n.DELTA OFF\r\n"));
  EXPECT_THAT(text, HasSubstr("\r\nC F1T1 4.0000 3.0000 8.0000 ! ! !\r\n")) << "north before east";
  EXPECT_THAT(text, HasSubstr("\r\nC 0x6a2f 0.0000 0.0000 8.0000 * * * 'Hal  A , ?\r\n"));
  EXPECT_THAT(text, HasSubstr("\r\nD F1T1-0x6a2f 5.0200 0.0500\r\n"));
  EXPECT_THAT(text, HasSubstr("# 0x6a2f: ok, 1 of 7 ranges that were used are listed, sigma 0.0200 0.0100 "
                              "0.0300 m (north, east, up)\r\n"));
  EXPECT_THAT(text, HasSubstr("latitude 51.023100000, longitude 3.713100000, ellipsoidal height 55.5000"));
}

// sigma / sqrt(w): 0.05 / sqrt(0.25) = 0.1. What is computed is 3-4-5.
TEST(StarnetListing, WidensTheErrorOfARangeByItsWeightAndShowsTheResidual) {
  const auto text = Made({range_of(5.02, 0.25)}).listing();
  EXPECT_THAT(text, HasSubstr("\r\nD F1T1-0x6a2f 5.0200 0.1000\r\n"));
  std::istringstream lines(text.substr(text.find("# F1T1-0x6a2f ")));
  std::string mark, pair, observed, computed, residual, sigma, standardised, weight, received, time;
  lines >> mark >> pair >> observed >> computed >> residual >> sigma >> standardised >> weight >> received >>
      time;
  EXPECT_EQ(observed, "5.0200");
  EXPECT_EQ(computed, "5.0000");
  EXPECT_EQ(residual, "0.0200");
  EXPECT_EQ(sigma, "0.0500");
  EXPECT_EQ(standardised, "0.400");
  EXPECT_EQ(weight, "0.250");
  EXPECT_EQ(received, "5.1000");
  EXPECT_EQ(time, "2026-05-04T10:00:00.000000Z");
}

TEST(StarnetListing, MakesARejectedRangeAComment) {
  const auto text = Made({range_of(6.5, 0.0)}).listing();
  EXPECT_THAT(text, HasSubstr("\r\n# D F1T1-0x6a2f 6.5000 0.0500  rejected\r\n"));
  EXPECT_THAT(text, Not(HasSubstr("\r\nD ")));
}

TEST(StarnetListing, HasAPlaceOnceThatSeveralRangesShare) {
  auto other = range_of(5.0, 1.0);
  other.tag_m = {3, 4, 8.0002};
  const auto text = Made({range_of(5.02, 1.0), range_of(5.03, 1.0), other}).listing();
  EXPECT_THAT(text, HasSubstr("\r\nC F1T2 4.0000 3.0000 8.0002 ! ! !\r\n"));
  EXPECT_THAT(text, Not(HasSubstr("F1T3")));
}

TEST(StarnetListing, KeepsAnAnchorWithoutAPositionOutOfTheAdjustment) {
  Made made({range_of(5.02, 1.0)});
  made.calibration.anchors[0].best.reset();
  const auto text = made.listing();
  EXPECT_THAT(text, Not(HasSubstr("\r\nC 0x6a2f")));
  EXPECT_THAT(text, Not(HasSubstr("\r\nD ")));
  EXPECT_THAT(text, HasSubstr("no position\r\n"));
}

TEST(StarnetListing, HoldsTheHeightThatTheSolveHeld) {
  Made made({range_of(5.02, 1.0)});
  made.calibration.settings = {R"({"dims":2})"};
  EXPECT_THAT(made.listing(), HasSubstr("\r\nC 0x6a2f 0.0000 0.0000 8.0000 * * !"));
}

TEST(StarnetListing, LeavesOutWhatIsNotFinite) {
  auto broken = range_of(5.02, 1.0);
  broken.tag_m.x() = std::nan("");
  const auto text = Made({broken}).listing();
  EXPECT_THAT(text, Not(HasSubstr("nan")));
  EXPECT_THAT(text, Not(HasSubstr("F1T1-")));
}

TEST(StarnetListing, IsRefusedWhereNoPlacesWereKept) {
  Made made({range_of(5.02, 1.0)});
  made.evidence.flights[0].observations = false;
  const auto refused = starnet_listing(made.calibration, made.evidence, {"anchord", {}});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, Errc::invalid_argument);
}

// What version 0.1 wrote: rows of five.
TEST(Evidence, OfAnEarlierVersionIsReadAndSaysThatItKeptNoPlaces) {
  Made made({range_of(5.02, 1.0)});
  auto json = Json::parse(evidence_json(made.evidence));
  const auto now = parse_evidence(json.dump());
  ASSERT_TRUE(now.has_value());
  EXPECT_TRUE(now.value().flights[0].observations);
  EXPECT_DOUBLE_EQ(now.value().flights[0].residuals.at(k_anchor)[0].tag_m.y(), 4.0);
  EXPECT_DOUBLE_EQ(now.value().flights[0].residuals.at(k_anchor)[0].corrected_m, 5.02);
  auto& row = json["flights"][0]["residuals"]["0x6a2f"][0];
  row.erase(row.begin() + 5, row.end());
  const auto before = parse_evidence(json.dump());
  ASSERT_TRUE(before.has_value());
  EXPECT_FALSE(before.value().flights[0].observations);
  EXPECT_DOUBLE_EQ(before.value().flights[0].residuals.at(k_anchor)[0].weight, 1.0);
}

/// A reader of the format that knows nothing of the writer: stations and distances.
struct Network {
  std::map<std::string, Eigen::Vector3d> at_m;
  std::map<std::string, bool> fixed;
  struct Distance {
    std::string from, to;
    double m{}, sigma_m{};
  };
  std::vector<Distance> distances;

  explicit Network(const std::string& text) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      line = line.substr(0, line.find('#'));
      std::istringstream words(line);
      std::string code, name;
      words >> code >> name;
      if (code == "C") {
        double north_m{}, east_m{}, up_m{};
        std::string mark;
        words >> north_m >> east_m >> up_m >> mark;
        at_m[name] = {east_m, north_m, up_m};
        fixed[name] = mark == "!";
        EXPECT_LE(name.size(), 15u) << "the longest name of the format";
      } else if (code == "D") {
        const auto dash = name.find('-');
        Distance d{name.substr(0, dash), name.substr(dash + 1)};
        words >> d.m >> d.sigma_m;
        distances.push_back(d);
      }
    }
  }
  /// Plain least squares of one free station, from its coordinates in the file moved by 0.5 m.
  Eigen::Vector3d adjusted(const std::string& station) const {
    Eigen::Vector3d x = at_m.at(station) + Eigen::Vector3d(0.3, -0.3, 0.27);
    for (int round = 0; round < 50; ++round) {
      Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
      Eigen::Vector3d right = Eigen::Vector3d::Zero();
      for (const auto& d : distances) {
        if (d.to != station) continue;
        EXPECT_TRUE(fixed.at(d.from));
        const Eigen::Vector3d way = x - at_m.at(d.from);
        const Eigen::Vector3d u = way.normalized();
        normal += u * u.transpose() / (d.sigma_m * d.sigma_m);
        right += u * (d.m - way.norm()) / (d.sigma_m * d.sigma_m);
      }
      const Eigen::Vector3d step = normal.ldlt().solve(right);
      x += step;
      if (step.norm() < 1e-9) break;
    }
    return x;
  }
};

// Weights of the last round and distances less what the flight shares: plain least squares then has its
// minimum where the robust joint solve has it. 404 ranges an anchor, so that all of them are kept.
TEST(StarnetListing, IsAdjustedToTheSamePositionsByPlainLeastSquares) {
  anchord::testing::MadeFlight made;
  made.duration_s = 50;
  made.nlos_share = 0.1;
  made.bias_m = 0.2;
  const auto flight = anchord::testing::make_flight(made);
  const auto solved = solve_flight(flight);
  ASSERT_TRUE(solved.has_value());
  Calibration calibration;
  for (const auto& anchor : solved.value().anchors) calibration.anchors.push_back(anchor.estimate);
  Evidence evidence;
  evidence.flights.push_back(evidence_of(flight, solved.value(), std::nullopt));
  const auto kept = parse_evidence(evidence_json(evidence));
  ASSERT_TRUE(kept.has_value());
  const auto listing = starnet_listing(calibration, kept.value(), {"anchord", {}});
  ASSERT_TRUE(listing.has_value());
  const Network network(listing.value());
  std::size_t n_used = 0;
  for (const auto& estimate : calibration.anchors) {
    ASSERT_TRUE(estimate.best.has_value());
    n_used += estimate.n_used;
    const auto& ours = estimate.best->position.m;
    EXPECT_LT((network.adjusted(to_string(estimate.anchor)) - ours).norm(), 1e-3)
        << to_string(estimate.anchor);
  }
  EXPECT_EQ(network.distances.size(), n_used) << "every range that was used, and no other";
}

class StarnetRoute : public AppFixture {
 protected:
  /// A stored calibration with this evidence; its residuals' path.
  std::string stored(const std::string& evidence) {
    Made made({range_of(5.02, 1.0)});
    auto& c = made.calibration;
    c.id.uuid = make_uuid_v7(clock_.now());
    c.missions = {MissionId{parse_uuid(mission()).value()}};
    c.settings = {"{}"};
    c.created = clock_.now();
    c.evidence = {evidence.empty() ? evidence_json(made.evidence) : evidence};
    EXPECT_TRUE(database_->stores().calibrations.insert(c).has_value());
    return "/api/v1/calibrations/" + to_string(c.id) + "/residuals";
  }
};

TEST_F(StarnetRoute, ServesTheListingAsAFile) {
  const auto path = stored("");
  const auto got = get(path, {{"format", "starnet"}});
  ASSERT_EQ(got.status, 200) << got.body;
  EXPECT_EQ(header(got, "Content-Type"), "text/plain; charset=utf-8");
  EXPECT_THAT(header(got, "Content-Disposition"), HasSubstr(".dat\""));
  EXPECT_THAT(got.body, HasSubstr("\r\nD F1T1-0x6a2f 5.0200 0.0500\r\n"));
  EXPECT_THAT(get(path, {{"format", "starnet"}, {"anchor", "0x6a3c"}}).body, Not(HasSubstr("0x6a2f")));
  EXPECT_EQ(get(path, {{"format", "landxml"}}).status, 406);
}

TEST_F(StarnetRoute, ShowsPlaceAndCorrectedRangeInJsonToo) {
  const auto item = json(get(stored("")))["items"].at(0);
  EXPECT_EQ(item["tag_m"], (Json{3.0, 4.0, 8.0}));
  EXPECT_EQ(item["corrected_m"], 5.02);
  EXPECT_EQ(item["sigma_m"], 0.05);
}

TEST_F(StarnetRoute, RefusesACalibrationOfAnEarlierVersionWithWhatToDo) {
  Made made({range_of(5.02, 1.0)});
  auto old = Json::parse(evidence_json(made.evidence));
  auto& row = old["flights"][0]["residuals"]["0x6a2f"][0];
  row.erase(row.begin() + 5, row.end());
  const auto path = stored(old.dump());
  const auto refused = get(path, {{"format", "starnet"}});
  EXPECT_EQ(refused.status, 422);
  EXPECT_THAT(refused.body, HasSubstr("calibrate its missions again"));
  const auto item = json(get(path))["items"].at(0);
  EXPECT_EQ(item["distance_m"], 5.1);
  EXPECT_TRUE(item["tag_m"].is_null());
}

}  // namespace
}  // namespace anchord::test::starnet_test
