#include "drivers/pozyx/values.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "drivers/pozyx/diagnostics.hpp"
#include "drivers/sim/impulse.hpp"

namespace anchord::pozyx::values_test {
namespace {

TEST(RangeInfo, IsReadAndItsFailureValuesAreNotRanges) {
  const Bytes data = unhex("C6020000CD0F0000AFFF").value();  // the sheet's example
  const RangeInfo info = range_info(data);
  EXPECT_EQ(info, (RangeInfo{710, 4045, -81}));
  EXPECT_EQ(fault_of(info, std::nullopt), RangeFault::none);
  EXPECT_EQ(fault_of(info, info), RangeFault::stale);
  EXPECT_EQ(fault_of({711, 0, -81}, info), RangeFault::zero_distance);
  EXPECT_EQ(fault_of({711, 167772160, 8192}, info), RangeFault::too_far);
  EXPECT_EQ(fault_of({711, 4000, 8192}, info), RangeFault::rss_impossible);
  EXPECT_EQ(fault_of({711, 4000, 0}, info), RangeFault::rss_impossible);
  EXPECT_EQ(fault_of({3, 4045, -81}, info), RangeFault::none) << "the tag was reset: its clock began anew";
}

TEST(UwbSettings, AreTheRegistersOfTheSheetBothWays) {
  const auto read = uwb_settings(unhex("05800C17").value()).value();
  EXPECT_EQ(read, (UwbSettings{5, 0, Prf::mhz64, 4096, 11.5}));
  EXPECT_EQ(hex(uwb_registers(read).value()), "05800c");
  EXPECT_EQ(gain_register(11.5), 0x17);
  EXPECT_FALSE(uwb_settings(unhex("06800C17").value())) << "there is no channel 6";
  EXPECT_FALSE(uwb_settings(unhex("05000C17").value())) << "PRF code 0";
  EXPECT_FALSE(uwb_settings(unhex("05800D17").value()));
  EXPECT_FALSE(uwb_registers({5, 0, Prf::mhz64, 100, {}}));
  EXPECT_FALSE(uwb_registers({5, 0, Prf::mhz64, 128, 40.0}));
  UwbSettings lower = read;
  lower.gain_db = 10.5;  // asked 11.5: a tag may read back a step less
  EXPECT_TRUE(same_air(read, lower));
  lower.preamble_symbols = 2048;
  EXPECT_FALSE(same_air(read, lower));
}

TEST(UwbSettings, LongerPreamblesTakeLonger) {
  EXPECT_NEAR(exchange_s({5, 0, Prf::mhz64, 4096, {}}), 0.027, 0.003);  // 3 x (4.17 ms + 1.46 ms) + 10 ms
  EXPECT_LT(exchange_s({5, 2, Prf::mhz64, 64, {}}), 0.011);
}

TEST(DeviceAdd, PutsMillimetresInTheSheetsOrder) {
  const auto data = device_add_parameters({0x6001, true, {-1.234, 567.890, 2.750}});
  EXPECT_EQ(hex(data.value()), "0160012efbffff52aa0800be0a0000");
  EXPECT_EQ(coordinates_m(unhex("2EFBFFFF52AA0800BE0A0000").value()),
            Eigen::Vector3d(-1.234, 567.890, 2.750));
  EXPECT_FALSE(device_add_parameters({1, true, {4e6, 0, 0}})) << "metres from the earth's centre do not fit";
  EXPECT_FALSE(device_add_parameters({1, true, {std::nan(""), 0, 0}}));
}

TEST(Heading, CountsOnlyWithACalibratedCompass) {
  EXPECT_EQ(absolute_heading_deg(90 * 16, 12, 0x03), 90.0);
  EXPECT_FALSE(absolute_heading_deg(90 * 16, 12, 0x02));
  EXPECT_FALSE(absolute_heading_deg(90 * 16, 8, 0xff)) << "relative mode";
  EXPECT_FALSE(absolute_heading_deg(-5, 12, 0x03));
  EXPECT_FALSE(check_firmware(0x01));
  EXPECT_TRUE(check_firmware(0x10));
}

TEST(CirDiagnostics, GiveTheLevelsOfAHandMadeRecord) {
  // Noise of constant modulus 10 (re 6, im 8); pulse 770, 1000, 730 at taps 746..748; level far above noise.
  std::vector<std::int16_t> taps;
  for (int k = 0; k < 1016; ++k) {
    const int pulse = k == 746 ? 770 : k == 747 ? 1000 : k == 748 ? 730 : 0;
    taps.push_back(static_cast<std::int16_t>(pulse ? pulse : 6));
    taps.push_back(static_cast<std::int16_t>(pulse ? 0 : 8));
  }
  const auto d = diagnose({taps, {}, 0}, -80.0, 121.74).value();
  // Threshold 64 crossed between 10 (tap 745) and 770: 746 - (770 - 64) / 760 = 745.071.
  EXPECT_NEAR(d.first_path_idx, 745.071, 0.001);
  EXPECT_DOUBLE_EQ(d.f1, 770);
  EXPECT_DOUBLE_EQ(d.f2, 1000);
  EXPECT_DOUBLE_EQ(d.f3, 730);
  EXPECT_DOUBLE_EQ(d.peak_idx, 747);
  // Energy 770^2 + 1000^2 + 730^2 - 3 * 100 (the noise of tap 745 cancels) = 2 125 500.
  EXPECT_NEAR(d.cir_power * 131072, 2'125'500, 1);
  EXPECT_NEAR(*d.fp_dbm, -80.0, 0.01);
  // N = sqrt(2125500 / 10^4.174) = 11.93.
  EXPECT_NEAR(*d.preamble_count, 11.93, 0.01);

  // The window and noise of the cheap read say the same.
  const std::span all(taps);
  const auto cheap =
      diagnose({all.subspan(2 * 672, 2 * 128), all.subspan(2 * 300, 2 * 32), 672}, -80.0, 121.74);
  ASSERT_TRUE(cheap);
  EXPECT_DOUBLE_EQ(cheap->first_path_idx, d.first_path_idx);
  EXPECT_NEAR(*cheap->fp_dbm, *d.fp_dbm, 0.01);
}

TEST(CirDiagnostics, OfNoiseOrScrapsAreNoValue) {
  std::vector<std::int16_t> noise;
  sim::Random random(3);
  for (int i = 0; i < 2 * 1016; ++i) noise.push_back(static_cast<std::int16_t>(25 * random.normal()));
  EXPECT_FALSE(diagnose({noise, {}, 0}, -90.0, 121.74));
  EXPECT_FALSE(diagnose({{}, {}, 0}, -90.0, 121.74));
  EXPECT_FALSE(diagnose({std::span(noise).first(10), std::span(noise).first(40), 672}, -90.0, 121.74));
}

TEST(CirDiagnostics, SeeAWallInTheSimulatedRecords) {
  sim::Random random(4);
  const auto difference = [&](double loss_db) {
    sim::Exchange exchange;
    exchange.rss_dbm = -84;
    exchange.wall_loss_db = loss_db;
    double sum = 0;
    int n = 0;
    for (int i = 0; i < 40; ++i) {
      const auto taps = sim::simulate_impulse(exchange, {}, random);
      if (const auto d = diagnose({taps, {}, 0}, -84.0, 121.74)) {
        sum += *d->rx_dbm - *d->fp_dbm;
        ++n;
      }
    }
    EXPECT_GT(n, 35);
    return sum / n;
  };
  EXPECT_GT(difference(21), difference(0) + 3);
}

}  // namespace
}  // namespace anchord::pozyx::values_test
