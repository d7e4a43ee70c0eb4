#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <random>

#include "../device/collect.hpp"
#include "../gnss/samples.hpp"
#include "drivers/device/settings.hpp"
#include "drivers/record/recorder.hpp"

// What the live pipeline makes of its events, a recording of them makes again, byte for byte.

namespace anchord::record::replay_test {
namespace {

namespace fs = std::filesystem;

struct Live {
  Live(const fs::path& folder, RecorderOptions options)
      : recorder(Recorder::open(folder, {1'795'243'500'000'000'000}, options).value()), pipeline(sink) {}
  void take(EventKind kind, std::uint16_t slot, std::int64_t steady, std::string_view payload = {}) {
    const Event event{kind, slot, {UtcTime{1'795'243'500'000'000'000 + steady}, steady}, payload};
    recorder->take(event);
    const auto done = pipeline.take(event);
    EXPECT_TRUE(done) << done.error().message;
  }
  std::unique_ptr<Recorder> recorder;
  device::test::Collect sink;
  device::Pipeline pipeline;
};

std::string replayed(const fs::path& first) {
  device::test::Collect sink;
  device::Pipeline pipeline(sink);
  const auto parts = parts_of(first).value();
  for (const auto& part : parts) {
    std::ifstream in(part, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    EventReader reader(text);
    EXPECT_TRUE(reader.begin());
    while (const auto event = reader.next()) (void)pipeline.take(*event);
  }
  return sink.rows;
}

std::string nmea_second(int i) {
  char text[160];
  std::snprintf(text, sizeof text, "GNRMC,1000%02d.00,A,5101.37%04d,N,00342.62,E,0.1,0.0,160624,,,R", i,
                10 * i);
  auto out = gnss::test::sentence(text);
  std::snprintf(text, sizeof text,
                "GNGGA,1000%02d.00,5101.37%04d,N,00342.62,E,4,14,0.9,22.500,M,45.012,M,0.8,0000", i, 10 * i);
  out += gnss::test::sentence(text);
  std::snprintf(text, sizeof text, "GNGST,1000%02d.00,,,,,0.012,0.011,0.02%d", i, i % 10);
  return out + gnss::test::sentence(text);
}

TEST(Replay, RebuildsTheSameRowsByteForByteThroughCutsNoiseTicksAndUnplugging) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const auto folder = fs::temp_directory_path() / ("anchord_replay_" + std::to_string(::getpid()));
    std::mt19937_64 random(seed);
    RecorderOptions options;
    options.rotate_bytes = 3000;
    fs::path first;
    std::string rows;
    std::size_t fixes = 0;
    {
      Live live(folder, options);
      first = live.recorder->file();
      for (const std::uint16_t slot : {std::uint16_t{1}, std::uint16_t{2}}) {
        live.take(EventKind::added, slot, 0,
                  device::to_json({"id" + std::to_string(slot), "gnss", "", "tcp://127.0.0.1:9001", "{}"}));
      }
      live.take(EventKind::mission, 0, 1, "0190f1f2-0000-7000-8000-000000000001");
      std::int64_t now = 1'000'000'000;
      for (int i = 0; i < 40; ++i) {
        for (const std::uint16_t slot : {std::uint16_t{1}, std::uint16_t{2}}) {
          std::string text = nmea_second(i);
          if (random() % 5 == 0) text.insert(random() % text.size(), "\xff$G\x01");
          std::int64_t at = now + static_cast<std::int64_t>(random() % 20'000'000);
          while (!text.empty()) {
            const auto n = 1 + random() % 90;
            live.take(EventKind::bytes, slot, at, text.substr(0, n));
            text.erase(0, n);
            at += 3'000'000;
          }
          if (const auto due = live.pipeline.deadline_ns(slot))
            live.take(EventKind::tick, slot, *due + 1'000'000);
          if (random() % 15 == 0) live.take(EventKind::closed, slot, at + 200'000'000);
        }
        now += 1'000'000'000;
      }
      rows = live.sink.rows;
      fixes = live.sink.fixes.size();
    }
    EXPECT_GT(parts_of(first).value().size(), 2U);
    EXPECT_GT(fixes, 30U) << "of 40: one of the two gives the track";
    EXPECT_EQ(replayed(first), rows) << "seed " << seed;
    fs::remove_all(folder);
  }
}

}  // namespace
}  // namespace anchord::record::replay_test
