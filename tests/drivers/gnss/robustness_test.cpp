#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "samples.hpp"

// Noise on the wire: nothing crashes, no frame with a wrong checksum is taken, and the next good one is
// found.

namespace anchord::gnss::robustness_test {
namespace {

using namespace test;

struct Stream {
  const char* name;
  std::string frames;  ///< several, then corrupted
  std::string last;    ///< good ones afterwards; the last of their epochs must come out
  bool checksummed;
};

std::string ubx_at(std::uint32_t itow_ms) {
  auto pvt = k_pvt.substr(0, k_pvt.size() - 2), hp = k_hp.substr(0, k_hp.size() - 2);
  for (std::size_t i = 0; i < 4; ++i) {
    pvt[6 + i] = static_cast<char>(itow_ms >> (8 * i));
    hp[10 + i] = static_cast<char>(itow_ms >> (8 * i));
  }
  return with_fletcher(pvt) + with_fletcher(hp);
}

std::string gga_at(int second) {
  char text[128];
  std::snprintf(text, sizeof text,
                "GNGGA,0900%02d.00,5101.3687380,N,00342.6274020,E,4,14,0.9,22.500,M,45.012,M,0.8,0000",
                second);
  return sentence(text);
}

std::string llh_at(int second) {
  char text[200];
  std::snprintf(
      text, sizeof text,
      "2024/06/16 00:00:%02d.600   51.022874322    3.710416541    61.0000   1  13   0.0140   0.0090   0.0210 "
      "  0.0000  -0.0000  -0.0000   1.10   12.5\n",
      second);
  return text;
}

std::string tpv_at(int second) {
  char text[200];
  std::snprintf(
      text, sizeof text,
      R"({"class":"TPV","mode":3,"status":3,"time":"2024-06-15T23:59:%02d.000Z","lat":51.02,"lon":3.71,"altHAE":63.5})"
      "\r\n",
      second);
  return text;
}

std::string erb_at(std::uint32_t tow_ms) {
  std::string out;
  for (const auto& frame : {k_erb_pos, k_erb_stat, k_erb_dops}) {
    auto one = frame.substr(0, frame.size() - 2);
    for (std::size_t i = 0; i < 4; ++i) one[5 + i] = static_cast<char>(tow_ms >> (8 * i));
    out += with_fletcher(one);
  }
  return out;
}

std::vector<Stream> streams() {
  const auto repeat = [](auto make, int from, int n) {
    std::string out;
    for (int i = 0; i < n; ++i) out += make(from + i);
    return out;
  };
  const auto ubx = [](int i) { return ubx_at(378'000'000U + 200U * static_cast<unsigned>(i)); };
  const auto erb = [](int i) { return erb_at(378'000'000U + 200U * static_cast<unsigned>(i)); };
  return {{"nmea", k_rmc + k_gga + k_gst + repeat(gga_at, 1, 3), "\r\n" + repeat(gga_at, 50, 3), true},
          {"ubx", repeat(ubx, 0, 3), repeat(ubx, 50, 3), true},
          {"erb", repeat(erb, 0, 3), repeat(erb, 50, 3), true},
          {"llh", repeat(llh_at, 1, 4), "\n" + repeat(llh_at, 50, 3), false},
          {"gpsd", repeat(tpv_at, 1, 4), "\n" + repeat(tpv_at, 50, 3), false}};
}

std::vector<std::string> frames_of(std::string_view bytes, bool checksummed) {
  Skips skips;
  Framer framer(std::nullopt, skips);
  std::vector<std::string> out;
  const auto keep = [&](const Frame& frame) {
    // A stray digit alone on a line is a (refused) line of LLH: only formats with a checksum are judged by
    // it.
    const bool line = frame.protocol == Protocol::llh || frame.protocol == Protocol::gpsd;
    if (!checksummed || !line) out.emplace_back(frame.bytes);
  };
  framer.feed(bytes, keep);
  framer.finish(keep);
  return out;
}

void expect_believable(const Epoch& e, const std::string& what) {
  for (const auto& value : {e.lat_deg, e.lon_deg, e.height_ellipsoid_m, e.height_msl_m, e.age_s, e.sigma_e_m,
                            e.sigma_n_m, e.sigma_u_m, e.hdop}) {
    if (value) {
      EXPECT_TRUE(std::isfinite(*value)) << what;
    }
  }
  if (e.lat_deg) {
    EXPECT_LE(std::abs(*e.lat_deg), 90) << what;
    EXPECT_LE(std::abs(e.lon_deg.value()), 180) << what;
    EXPECT_NE(e.fix, FixClass::none) << what;
  }
}

/// One byte changed, removed or put in.
std::string corrupted(std::string bytes, std::mt19937_64& random) {
  const std::size_t at = random() % bytes.size();
  switch (random() % 3) {
    case 0:
      bytes[at] = static_cast<char>(bytes[at] ^ static_cast<char>(1 + random() % 255));
      break;
    case 1:
      bytes.erase(at, 1);
      break;
    default:
      bytes.insert(at, 1, static_cast<char>(random() % 256));
      break;
  }
  return bytes;
}

class Robustness : public testing::TestWithParam<std::size_t> {
 protected:
  Stream stream_ = streams()[GetParam()];
};

TEST_P(Robustness, TenThousandCorruptionsGiveNoFalseFrameAndTheNextGoodOneIsFound) {
  std::mt19937_64 random(7 + GetParam());
  const auto good = frames_of(stream_.frames, stream_.checksummed);
  const auto last_epochs = decode(stream_.last);
  ASSERT_FALSE(last_epochs.empty());
  const std::set<std::string> known(good.begin(), good.end());
  for (int i = 0; i < 10'000; ++i) {
    const auto bytes = corrupted(stream_.frames, random);
    if (stream_.checksummed) {
      for (const auto& frame : frames_of(bytes, stream_.checksummed))
        EXPECT_EQ(known.count(frame), 1U) << stream_.name << " case " << i;
    }
    const auto epochs = decode(bytes + stream_.last);
    ASSERT_FALSE(epochs.empty());
    for (const auto& e : epochs) expect_believable(e, stream_.name);
    EXPECT_EQ(epochs.back().time_of_day_ns, last_epochs.back().time_of_day_ns)
        << stream_.name << " case " << i;
    EXPECT_EQ(epochs.back().lat_deg, last_epochs.back().lat_deg) << stream_.name << " case " << i;
  }
}

TEST_P(Robustness, EveryPrefixIsHarmlessAndGivesOnlyFramesOfTheWhole) {
  const auto bytes = stream_.frames + stream_.last;
  const auto good = frames_of(bytes, stream_.checksummed);
  const std::set<std::string> known(good.begin(), good.end());
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    const auto prefix = std::string_view(bytes).substr(0, n);
    if (std::string_view(stream_.name) != "gpsd") {  // a cut JSON line reaches the parser, which refuses it
      for (const auto& frame : frames_of(prefix, stream_.checksummed))
        EXPECT_EQ(known.count(frame), 1U) << stream_.name << " at " << n;
    }
    for (const auto& e : decode(prefix)) expect_believable(e, stream_.name);
  }
}

TEST_P(Robustness, GarbageBetweenFramesCostsNone) {
  std::mt19937_64 random(99);
  const auto expected = decode(stream_.frames + stream_.last).size();
  for (int i = 0; i < 200; ++i) {
    std::string noise(random() % 300, '\0');
    for (auto& c : noise) c = static_cast<char>(random());
    EXPECT_EQ(decode(stream_.frames + noise + "\n" + stream_.last).size(), expected)
        << stream_.name << " case " << i;
  }
}

TEST_P(Robustness, PureNoiseGivesNothingBelievableAndStaysSmall) {
  std::mt19937_64 random(5);
  std::string noise(300'000, '\0');
  for (auto& c : noise) c = static_cast<char>(random());
  Decoder decoder;
  Epochs out;
  decoder.feed(noise, out);
  decoder.finish(out);
  EXPECT_TRUE(out.empty());
  EXPECT_LT(decoder.skips().entries().size(), 30U);
}

INSTANTIATE_TEST_SUITE_P(Formats, Robustness, testing::Range<std::size_t>(0, 5),
                         [](const auto& param) { return std::string(streams()[param.param].name); });

}  // namespace
}  // namespace anchord::gnss::robustness_test
