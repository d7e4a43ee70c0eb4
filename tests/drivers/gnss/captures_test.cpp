#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <tuple>

#include "drivers/gnss/text.hpp"
#include "samples.hpp"
#include "tests/paths.hpp"

// Recorded logs and the values an independent decoder (or the producer's own input) has for them.

namespace anchord::gnss::captures_test {
namespace {

using namespace test;

std::string capture(const std::string& name) {
  std::ifstream file(std::filesystem::path(ANCHORD_SHARED_DATA) / "rtk" / name, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Rows of a CSV by column name.
std::vector<std::map<std::string, std::string>> table(const std::string& name) {
  const std::string text = capture(name);
  std::vector<std::map<std::string, std::string>> out;
  std::vector<std::string_view> names;
  for (auto line : split(text, "\n", true)) {
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    const auto cells = split(line, ",", false);
    if (names.empty()) {
      names = cells;
      continue;
    }
    auto& row = out.emplace_back();
    for (std::size_t i = 0; i < names.size() && i < cells.size(); ++i) row[std::string(names[i])] = cells[i];
  }
  return out;
}

class Captures : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(std::filesystem::path(ANCHORD_SHARED_DATA) / "rtk")) {
      GTEST_SKIP() << "recorded RTK logs not found at " ANCHORD_SHARED_DATA "/rtk: these tests did not run";
    }
  }
};

void expect_near(const std::optional<double>& value, const std::string& expected, double tolerance,
                 const std::string& what) {
  if (expected.empty()) {
    EXPECT_FALSE(value) << what;
  } else {
    ASSERT_TRUE(value) << what;
    EXPECT_NEAR(*value, std::stod(expected), tolerance) << what;
  }
}

void expect_gga(const Epoch& e, std::map<std::string, std::string> row, const std::string& what) {
  expect_near(e.lat_deg, row["lat_deg"], 6e-10, what);  // half of the ninth decimal
  expect_near(e.lon_deg, row["lon_deg"], 6e-10, what);
  expect_near(e.height_msl_m, row["alt_msl_m"], 1e-9, what);
  expect_near(e.height_ellipsoid_m, row["alt_hae_m"], 1e-4, what);
  expect_near(e.hdop, row["hdop"], 1e-9, what);
  expect_near(e.age_s, row["age_s"], 1e-9, what);
  if (!row["nsat"].empty()) {
    EXPECT_EQ(e.satellites, std::stoi(row["nsat"])) << what;
  }
  if (!row["hhmmss"].empty()) {
    const auto clock = to_rfc3339(e.time.value()).substr(11, 8);
    EXPECT_EQ(clock.substr(0, 2) + clock.substr(3, 2) + clock.substr(6, 2), row["hhmmss"].substr(0, 6))
        << what;
  }
}

TEST_F(Captures, ZedX20pUbx) {
  const auto epochs = decode(capture("dev1_zed_x20p_nav.ubx"));
  const auto rows = table("dev1_zed_x20p_nav.ubx.expected.csv");
  ASSERT_EQ(epochs.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    auto row = rows[i];
    const auto& e = epochs[i];
    expect_near(e.lat_deg, row["hp_lat"], 1e-12, "lat");
    expect_near(e.lon_deg, row["hp_lon"], 1e-12, "lon");
    expect_near(e.height_ellipsoid_m, row["hp_hae"], 1e-9, "height");
    expect_near(e.height_msl_m, row["hp_msl"], 1e-9, "msl");
    EXPECT_EQ(e.satellites, std::stoi(row["ns"]));
    EXPECT_EQ(e.fix, FixClass::single);
    EXPECT_EQ(to_rfc3339(e.time.value()).substr(0, 19), row["utc"].substr(0, 19));
    EXPECT_EQ(e.time->ns % 1'000'000'000, std::stol(row["nano"]));
  }
  // hAcc is the root of east and north variance together: NAV-COV must say the same.
  EXPECT_NEAR(std::hypot(epochs[0].sigma_e_m.value(), epochs[0].sigma_n_m.value()), 2.6864, 1e-3);
  EXPECT_NEAR(epochs[0].sigma_u_m.value(), 2.8003, 1e-3);
}

TEST_F(Captures, MixedNmeaAndUbxWithABadChecksum) {
  Skips skips;
  const auto epochs = decode(capture("dev2_mixed_nmea_ubx_badck.bin"), {}, &skips);
  EXPECT_EQ(skips["ubx: checksum wrong"], 1U);
  ASSERT_EQ(epochs.size(), 3U);
  auto pvt = table("dev2_mixed_nmea_ubx_badck.bin.expected.csv").at(0);
  expect_near(epochs[0].lat_deg, pvt["lat"], 1e-12, "lat");
  expect_near(epochs[0].height_ellipsoid_m, pvt["hae"], 1e-9, "height");
  EXPECT_EQ(epochs[0].satellites, 7);
  EXPECT_EQ(to_rfc3339(epochs[0].time.value()), "2022-01-18T08:02:46.999824Z");  // :47 minus 175377 ns
  const auto rows = table("dev2_mixed_nmea_ubx_badck.bin.gga.expected.csv");
  for (std::size_t i = 0; i < rows.size(); ++i)
    expect_gga(epochs[1 + i], rows[i], "row " + std::to_string(i));
  EXPECT_EQ(to_rfc3339(epochs[2].time.value()), "2022-01-18T08:02:48.000000Z");  // the date is UBX's
}

TEST_F(Captures, SkytraqDgps) {
  Decoder decoder;
  Epochs epochs;
  decoder.feed(capture("dev3_skytraq_dgps.nmea"), epochs);
  decoder.finish(epochs);
  EXPECT_EQ(decoder.frames(Protocol::nmea), 1024U);
  const auto rows = table("dev3_skytraq_dgps.nmea.expected.csv");
  ASSERT_EQ(epochs.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    expect_gga(epochs[i], rows[i], "row " + std::to_string(i));
    EXPECT_EQ(epochs[i].fix, FixClass::dgps);
    EXPECT_TRUE(epochs[i].sigma_u_m);
  }
}

TEST_F(Captures, GeonetLlhInGpsTime) {
  const auto epochs = decode(capture("dev4_geonet_rtk.llh"));
  ASSERT_EQ(epochs.size(), 30U);
  for (const auto& e : epochs) {
    EXPECT_EQ(e.fix, FixClass::rtk_fixed);
    EXPECT_NEAR(e.lat_deg.value(), 35.16087253, 1e-6);
    EXPECT_NEAR(e.lon_deg.value(), 139.61383678, 1e-6);
    EXPECT_NEAR(e.height_ellipsoid_m.value(), 69.87, 0.05);
  }
  // 2005/04/02 00:00:00 GPST; 13 leap seconds then.
  EXPECT_EQ(to_rfc3339(epochs[0].time.value()), "2005-04-01T23:59:47.000000Z");
}

constexpr FixClass fix_of_stat(int stat) {
  return stat == 1   ? FixClass::rtk_fixed
         : stat == 2 ? FixClass::rtk_float
         : stat == 5 ? FixClass::single
                     : FixClass::none;
}

/// RFC 3339 of "2025/03/04 09:15:01.200".
std::string utc_of(std::string text) {
  text[4] = text[7] = '-';
  text[10] = 'T';
  return text + "000Z";
}

TEST_F(Captures, EmlidErbAgreesWithWhatWentIntoTheEncoder) {
  Decoder decoder;
  Epochs epochs;
  decoder.feed(capture("dev5_emlid_demo.erb"), epochs);
  decoder.finish(epochs);
  EXPECT_EQ(decoder.frames(Protocol::erb), 420U);
  const auto rows = table("dev5_emlid_demo.truth.csv");
  ASSERT_EQ(epochs.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    auto row = rows[i];
    const auto& e = epochs[i];
    EXPECT_EQ(to_rfc3339(e.time.value()), utc_of(row["utc"]));
    EXPECT_EQ(e.fix, fix_of_stat(std::stoi(row["stat"])));
    EXPECT_EQ(e.satellites, std::stoi(row["ns"]));
    if (e.fix == FixClass::none) {
      EXPECT_FALSE(e.lat_deg);
      continue;
    }
    expect_near(e.lat_deg, row["lat_deg"], 1e-9, "lat");
    expect_near(e.lon_deg, row["lon_deg"], 1e-9, "lon");
    expect_near(e.height_ellipsoid_m, row["h_ell_m"], 1e-4, "height");
    EXPECT_NEAR(e.baseline_ned_m.value().x(), std::stod(row["base_n_mm"]) / 1000,
                1.5e-3);  // the encoder cuts off
    EXPECT_NEAR(e.baseline_ned_m.value().y(), std::stod(row["base_e_mm"]) / 1000,
                1.5e-3);  // the encoder cuts off
    if (std::stod(row["age_s"]) > 0) expect_near(e.age_s, row["age_s"], 1e-9, "age");
  }
}

TEST_F(Captures, EmlidNmeaAgreesWithTheOtherDecoderAndTheTruth) {
  const auto epochs = decode(capture("dev5_emlid_demo.nmea"));
  const auto rows = table("dev5_emlid_demo.nmea.expected.csv"), truth = table("dev5_emlid_demo.truth.csv");
  ASSERT_EQ(epochs.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    expect_gga(epochs[i], rows[i], "row " + std::to_string(i));
    auto row = truth[i];
    EXPECT_EQ(epochs[i].fix, fix_of_stat(std::stoi(row["stat"])));
    if (epochs[i].fix == FixClass::none) continue;
    EXPECT_EQ(to_rfc3339(epochs[i].time.value()), utc_of(row["utc"]));
    // This encoder swaps the axes; the larger for both never says less than the truth.
    const double larger = std::max(std::stod(row["sd_n"]), std::stod(row["sd_e"]));
    EXPECT_NEAR(epochs[i].sigma_n_m.value(), larger, 1e-3);
    EXPECT_NEAR(epochs[i].sigma_e_m.value(), larger, 1e-3);
    EXPECT_NEAR(epochs[i].sigma_u_m.value(), std::stod(row["sd_u"]), 1e-3);
  }
}

TEST_F(Captures, EmlidLlhAgreesWithWhatWentIntoTheEncoder) {
  const auto epochs = decode(capture("dev5_emlid_demo.llh"));
  std::vector<std::map<std::string, std::string>> rows;
  for (auto& row : table("dev5_emlid_demo.truth.csv")) {
    if (row["stat"] != "0") rows.push_back(row);  // nothing is printed without a solution
  }
  ASSERT_EQ(epochs.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    auto row = rows[i];
    const auto& e = epochs[i];
    EXPECT_EQ(to_rfc3339(e.time.value()), utc_of(row["utc"]));
    EXPECT_EQ(e.fix, fix_of_stat(std::stoi(row["stat"])));
    expect_near(e.lat_deg, row["lat_deg"], 1e-9, "lat");
    expect_near(e.lon_deg, row["lon_deg"], 1e-9, "lon");
    expect_near(e.height_ellipsoid_m, row["h_ell_m"], 1e-4, "height");
    expect_near(e.sigma_n_m, row["sd_n"], 1e-4, "sigma n");
    expect_near(e.sigma_e_m, row["sd_e"], 1e-4, "sigma e");
    expect_near(e.sigma_u_m, row["sd_u"], 1e-4, "sigma u");
    EXPECT_EQ(e.satellites, std::stoi(row["ns"]));
  }
}

TEST_F(Captures, DecodeTheSameHoweverTheBytesAreCut) {
  for (const char* name : {"dev1_zed_x20p_nav.ubx", "dev2_mixed_nmea_ubx_badck.bin", "dev3_skytraq_dgps.nmea",
                           "dev4_geonet_rtk.llh", "dev5_emlid_demo.erb", "dev5_emlid_demo.nmea"}) {
    const auto bytes = capture(name);
    const auto whole = decode(bytes);
    for (const std::size_t piece : {1U, 7U, 1000U}) {
      Decoder decoder;
      Epochs pieces;
      for (std::size_t i = 0; i < bytes.size(); i += piece)
        decoder.feed(std::string_view(bytes).substr(i, piece), pieces);
      decoder.finish(pieces);
      ASSERT_EQ(pieces.size(), whole.size()) << name;
      for (std::size_t i = 0; i < whole.size(); ++i) {
        EXPECT_EQ(pieces[i].time, whole[i].time);
        EXPECT_EQ(pieces[i].lat_deg, whole[i].lat_deg);
      }
    }
  }
}

/// Every position a prefix gives must be one the whole capture gives; cut at every byte.
TEST_F(Captures, EveryPrefixGivesOnlyPositionsOfTheWhole) {
  using Position = std::tuple<double, double, double>;
  for (const char* name :
       {"dev1_zed_x20p_nav.ubx", "dev2_mixed_nmea_ubx_badck.bin", "dev3_skytraq_dgps.nmea",
        "dev4_geonet_rtk.llh", "dev5_emlid_demo.erb", "dev5_emlid_demo.nmea", "dev5_emlid_demo.llh"}) {
    const auto bytes = capture(name);
    std::set<Position> known;
    const auto position = [](const Epoch& e) {
      return Position(e.lat_deg.value_or(0), e.lon_deg.value_or(0), e.height_ellipsoid_m.value_or(0));
    };
    for (const auto& e : decode(bytes)) known.insert(position(e));
    // PVT without its HPPOSLLH yet, and RMC without its GGA, are coarser forms of the same epoch.
    for (std::size_t n = 0; n < bytes.size(); ++n) {
      // Quadratic: far into a long capture the last epochs before the cut stand for all.
      const std::size_t from = n > 3000 ? n - 1500 : 0;
      for (const auto& e : decode(std::string_view(bytes).substr(from, n - from))) {
        const bool coarse = !e.height_ellipsoid_m || e.protocol == Protocol::ubx;
        ASSERT_TRUE(coarse || known.count(position(e)) == 1) << name << " cut at " << n;
      }
    }
  }
}

}  // namespace
}  // namespace anchord::gnss::captures_test
