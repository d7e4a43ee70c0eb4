#include "server/gateway/outbox.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <thread>

#include "tests/full_disk.hpp"
#include "tests/scratch_dir.hpp"
#include "tests/server/storage/child.hpp"

namespace anchord::gateway::outbox_test {
namespace {

constexpr std::uint64_t k_roomy = 64u << 20;
const MissionId k_first{parse_uuid("01890a5d-ac96-774b-bcce-b302099a8057").value()};
const MissionId k_second{parse_uuid("01890a5d-ac96-774b-bcce-b302099a8058").value()};

Batch batch(const MissionId& mission, const std::string& body, std::uint32_t n_rows = 1) {
  return {{}, mission, Lines::ranges_csv, n_rows, UtcTime::from_us(1'777'889'472'000'000), body};
}
std::unique_ptr<Outbox> opened(const std::filesystem::path& dir, std::uint64_t max_bytes = k_roomy) {
  auto outbox = Outbox::open(dir, max_bytes);
  if (!outbox) ADD_FAILURE() << outbox.error().message;
  return outbox ? std::move(outbox).value() : nullptr;
}
std::vector<std::string> bodies(const std::vector<Batch>& batches) {
  std::vector<std::string> out;
  for (const auto& one : batches) out.push_back(one.body);
  return out;
}
using Texts = std::vector<std::string>;

TEST(GatewayOutbox, GivesTheNewestFirstAndTheOldestOfOneMission) {
  ScratchDir dir;
  const auto outbox = opened(dir.path());
  ASSERT_TRUE(outbox->keep({batch(k_first, "a\n"), batch(k_second, "b\n"), batch(k_first, "c\n")}));
  ASSERT_TRUE(outbox->keep({batch(k_first, "d\n")}));
  const auto newest = outbox->newest(0, 4).value();
  EXPECT_EQ(bodies(newest.batches), (Texts{"d\n", "c\n"}));
  EXPECT_TRUE(newest.more);
  const auto after = newest.batches.back().id;
  EXPECT_EQ(bodies(outbox->newest(after, 100).value().batches), (Texts{"d\n"}));
  EXPECT_EQ(bodies(outbox->oldest(after, {}, 100).value()), (Texts{"a\n", "c\n"}));
  EXPECT_EQ(bodies(outbox->oldest(after, {k_first}, 100).value()), (Texts{"b\n"}));
  EXPECT_EQ(bodies(outbox->oldest(after, {}, 1).value()), (Texts{"a\n"}));  // one at least
  EXPECT_TRUE(outbox->oldest(after, {k_first, k_second}, 100).value().empty());
}

TEST(GatewayOutbox, KeepsRowsAndTotalsOverARestartAndNeverGivesAnIdTwice) {
  ScratchDir dir;
  std::int64_t last = 0;
  {
    const auto outbox = opened(dir.path());
    ASSERT_TRUE(outbox->keep({batch(k_first, "a\nb\n", 2), batch(k_first, "c\n")}));
    const auto all = outbox->oldest(100, {}, 100).value();
    ASSERT_EQ(all.size(), 2u);
    last = all.back().id;
    ASSERT_TRUE(outbox->delivered({{all[0].id, last}, 1, 1, 1}));
    ASSERT_TRUE(outbox->note_mission({k_second, UtcTime::from_us(5)}));
  }
  const auto outbox = opened(dir.path());
  const auto state = outbox->state();
  EXPECT_EQ(state.rows, 0u);
  EXPECT_EQ(state.bytes, 0u);
  EXPECT_EQ(state.totals.kept, 3u);
  EXPECT_EQ(state.totals.accepted, 1u);
  EXPECT_EQ(state.totals.rejected, 1u);
  EXPECT_EQ(outbox->last_mission().value()->mission, k_second);
  ASSERT_TRUE(outbox->keep({batch(k_first, "d\n")}));
  EXPECT_GT(outbox->oldest(1000, {}, 100).value().front().id, last);
}

TEST(GatewayOutbox, RefusesWhatComesWhenItIsFullAndTakesAgainWhenRowsHaveLeft) {
  ScratchDir dir;
  const auto outbox = opened(dir.path(), 1000);
  const std::string body(700, 'x');
  ASSERT_TRUE(outbox->keep({batch(k_first, body)}));
  const auto full = outbox->keep({batch(k_first, body)});
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().code, Errc::storage_full);
  EXPECT_NE(full.error().message.find("--max-mib"), std::string::npos);
  EXPECT_EQ(outbox->state().rows, 1u);
  ASSERT_TRUE(outbox->delivered({{outbox->newest(0, 1).value().batches.front().id}, 1, 0, 0}));
  EXPECT_TRUE(outbox->keep({batch(k_first, body)}));
}

TEST(GatewayOutbox, OnAFullDiskRowsLeaveFromMemoryAndWhatLeftIsNotSentAgain) {
  ScratchDir dir;
  const auto outbox = opened(dir.path());
  ASSERT_TRUE(outbox->keep({batch(k_first, "a\n"), batch(k_second, "b\n")}));
  const auto kept = outbox->newest(0, 100).value().batches;
  ASSERT_EQ(kept.size(), 2u);
  {
    const test::FullDisk full;
    ASSERT_FALSE(outbox->keep({batch(k_first, "c\n")}));
    ASSERT_TRUE(outbox->hold({batch(k_first, "c\n"), batch(unassigned(), "d\n"), batch(k_first, "e\n")}));
    EXPECT_EQ(outbox->state().rows, 5u);
    EXPECT_EQ(outbox->state().rows_in_memory, 3u);
    EXPECT_NE(outbox->state().trouble, "");
    const auto newest = outbox->newest(0, 4).value();
    EXPECT_EQ(bodies(newest.batches), (Texts{"e\n", "c\n"})) << "those with a mission, newest first";
    EXPECT_TRUE(newest.more);
    EXPECT_FALSE(outbox->delivered({{kept[1].id, newest.batches[0].id}, 2, 0, 0}));
    EXPECT_EQ(bodies(outbox->newest(0, 100).value().batches), (Texts{"c\n", "b\n"}));
    EXPECT_EQ(bodies(outbox->oldest(1000, {}, 100).value()), (Texts{"b\n"}))
        << "k_first's on the disk has left";
    EXPECT_EQ(bodies(outbox->oldest(1000, {k_second}, 100).value()), (Texts{"c\n"}));
    EXPECT_EQ(outbox->state().rows, 3u);
    EXPECT_FALSE(outbox->try_disk());
  }
  EXPECT_TRUE(outbox->try_disk());
  EXPECT_EQ(outbox->state().trouble, "");
  EXPECT_EQ(outbox->state().rows_in_memory, 0u);
  EXPECT_EQ(outbox->state().unassigned_rows, 1u);
  EXPECT_EQ(bodies(outbox->newest(0, 100).value().batches), (Texts{"c\n", "b\n"}));
  EXPECT_EQ(outbox->state().totals.kept, 5u);
  EXPECT_EQ(outbox->state().totals.accepted, 2u);
}

TEST(GatewayOutbox, WhatWasInMemoryIsThereAfterARestartOnceTheDiskTookIt) {
  ScratchDir dir;
  std::uint64_t bytes = 0;
  {
    const auto outbox = opened(dir.path());
    {
      const test::FullDisk full;
      ASSERT_TRUE(outbox->hold({batch(k_first, "a\nb\n", 2)}));
      EXPECT_TRUE(outbox->hold({batch(k_first, std::string(Outbox::k_most_held_bytes / 2, 'x'))}));
      EXPECT_FALSE(outbox->hold({batch(k_first, std::string(Outbox::k_most_held_bytes / 2, 'x'))}))
          << "there is no room for it";
    }
    ASSERT_TRUE(outbox->keep({batch(k_first, "c\n")}));
    EXPECT_EQ(outbox->state().rows_in_memory, 0u) << "they come to the disk with the next";
    bytes = outbox->state().bytes;
  }
  const auto outbox = opened(dir.path());
  EXPECT_EQ(outbox->state().rows, 4u);
  EXPECT_EQ(outbox->state().bytes, bytes);
  EXPECT_EQ(outbox->state().totals.kept, 4u);
  EXPECT_EQ(outbox->oldest(1000, {}, 4).value().front().body, "a\nb\n");
}

TEST(GatewayOutbox, IsMadeOnceAndAMissingOneIsALossUntilAPersonSaysOtherwise) {
  ScratchDir dir;
  { ASSERT_TRUE(opened(dir.path())->keep({batch(k_first, "a\n")})); }
  for (const char* part : {"", "-wal", "-shm"})
    std::filesystem::remove((dir.path() / "outbox.db").string() + part);
  const auto refused = Outbox::open(dir.path(), k_roomy);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::storage_unavailable);
  EXPECT_NE(refused.error().message.find("--new-outbox"), std::string::npos) << refused.error().message;
  EXPECT_FALSE(std::filesystem::exists(dir.path() / "outbox.db"));
  const auto anew = Outbox::open(dir.path(), k_roomy, true);
  ASSERT_TRUE(anew) << anew.error().message;
  EXPECT_EQ(anew.value()->state().rows, 0u);
}

TEST(GatewayOutbox, KeepsNothingMoreOnceItsFileWasRemovedAndSavesWhatItHad) {
  ScratchDir dir;
  const auto file = dir.path() / "outbox.db";
  {
    const auto outbox = opened(dir.path());
    ASSERT_TRUE(outbox->keep({batch(k_first, "a\n")}));
    for (const char* part : {"", "-wal", "-shm"}) std::filesystem::remove(file.string() + part);
    const auto refused = outbox->keep({batch(k_first, "b\n")});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::storage_unavailable);
  }
  std::filesystem::rename(file.string() + ".saved-1", file);
  EXPECT_EQ(bodies(opened(dir.path())->newest(0, 100).value().batches), (Texts{"a\n"}));
}

TEST(GatewayOutbox, SendsRowsWithoutAMissionOnlyOnceTheyHaveOne) {
  ScratchDir dir;
  const auto outbox = opened(dir.path());
  ASSERT_TRUE(outbox->keep({batch(unassigned(), "a\nb\n", 2), batch(k_first, "c\n")}));
  EXPECT_EQ(outbox->state().unassigned_rows, 2u);
  EXPECT_EQ(bodies(outbox->newest(0, 100).value().batches), (Texts{"c\n"}));
  EXPECT_EQ(bodies(outbox->oldest(100, {k_first}, 100).value()), Texts{});
  EXPECT_EQ(outbox->assign(k_second).value(), 2u);
  EXPECT_EQ(outbox->state().unassigned_rows, 0u);
  EXPECT_EQ(bodies(outbox->oldest(100, {k_first}, 100).value()), (Texts{"a\nb\n"}));
}

TEST(GatewayOutbox, RefusesAFolderOfAServerAndAFileThatIsNoOutbox) {
  ScratchDir dir;
  std::ofstream(dir.path() / "anchord.db") << "rows";
  const auto server = Outbox::open(dir.path(), k_roomy);
  ASSERT_FALSE(server);
  EXPECT_EQ(server.error().code, Errc::conflict);
  ScratchDir other;
  std::ofstream(other.path() / "outbox.db") << std::string(4096, 'x');
  EXPECT_FALSE(Outbox::open(other.path(), k_roomy));
  ScratchDir twice;
  const auto held = opened(twice.path());
  EXPECT_FALSE(Outbox::open(twice.path(), k_roomy));
}

/// Writes until it is killed: a byte for each batch that it was told is on the disk.
int keep_on(const std::filesystem::path& dir, int out) {
  const auto outbox = Outbox::open(dir, k_roomy);
  if (!outbox) return 1;
  auto& box = *outbox.value();
  for (int i = 0;; ++i) {
    if (!box.keep({batch(k_first, std::to_string(i) + "\n")})) return 2;
    if (::write(out, "k", 1) != 1) return 3;
    // Something leaves meanwhile, as when the link is up: the odd ones of those that were there before.
    if (i % 8 != 7) continue;
    const auto oldest = box.oldest(1 << 30, {}, 1);
    if (oldest && !oldest.value().empty() && oldest.value().front().id % 2 == 1) {
      if (!box.delivered({{oldest.value().front().id}, 1, 0, 0})) return 4;
    }
  }
}

TEST(GatewayOutbox, HasEveryRowItAcknowledgedAfterKill9AtRandomInstants) {
  ScratchDir dir;
  std::mt19937 random(20261125);  // of the instants alone
  std::uint64_t acknowledged = 0;
  for (int round = 0; round < 25; ++round) {
    Child child([&](int out) { return keep_on(dir.path(), out); });
    for (auto n = 1 + random() % 20; n > 0 && child.read_byte(); --n) ++acknowledged;
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 2000));
    child.kill_now();
    while (child.read_byte()) ++acknowledged;  // written before its end: acknowledged as well
    const auto outbox = opened(dir.path());
    ASSERT_TRUE(outbox);
    const auto state = outbox->state();
    ASSERT_GE(state.totals.kept, acknowledged) << "round " << round;
    ASSERT_LE(state.totals.kept, acknowledged + 1) << "round " << round;
    ASSERT_EQ(state.rows + state.totals.accepted, state.totals.kept) << "round " << round;
    acknowledged = state.totals.kept;  // the one that was committed and not told
  }
  EXPECT_GT(acknowledged, 100u);
}

}  // namespace
}  // namespace anchord::gateway::outbox_test
