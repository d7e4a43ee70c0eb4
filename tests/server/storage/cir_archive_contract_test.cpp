// Impulse responses in files beside the database, over every backend: what is read stays what was measured,
// whatever happens in between.
#include <csignal>
#include <fstream>

#include "core/ports/cir_archive.hpp"
#include "core/ports/mission_bin.hpp"
#include "server/storage/cir_file.hpp"
#include "tests/server/storage/backends.hpp"
#include "tests/server/storage/bundle_rows.hpp"
#include "tests/server/storage/child.hpp"

namespace anchord::cir_archive_contract_test {
namespace {

namespace fs = std::filesystem;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using enum RowOutcome;

constexpr int k_ranges = 330;
constexpr UtcTime k_landed{k_noon.ns + 600'000'000'000}, k_later{k_noon.ns + 86'400'000'000'000};
const CirArchive::GoOn k_go_on = [] { return true; };

/// Each different; every fifth range has none, every seventh is of another radio and says less.
std::optional<Cir> cir_of(int i) {
  if (i % 5 == 0) return std::nullopt;
  Cir cir;
  for (int k = 0; k < 200; ++k)
    cir.re_im.push_back(static_cast<std::int16_t>((i * 7919 + k * k * 31) % 65'536 - 32'768));
  cir.first_path_idx = 744.25 + i;
  cir.preamble_count = 1000 + i;
  if (i % 7 == 0) {
    cir.dt_ps = 1016.5;
    cir.first_path_idx.reset();
  }
  if (i == 6) cir.re_im.clear();
  return cir;
}

std::string text_of(const std::optional<Cir>& cir) {
  if (!cir) return "none";
  std::string out = std::to_string(cir->dt_ps) + ' ' + std::to_string(cir->first_path_idx.value_or(-1)) +
                    ' ' + std::to_string(cir->preamble_count.value_or(-1));
  for (const auto sample : cir->re_im) out += ' ' + std::to_string(sample);
  return out;
}

class CirArchiveContract : public StoreContract {
 protected:
  CirArchive& archive() { return db_->cir_archive(); }
  static Range row(const MissionId& mission, int i) {
    Range range = range_at(mission, i);
    range.cir = cir_of(i);
    if (i % 3 == 0) range.seq.reset();
    return range;
  }
  std::vector<RowOutcome> append(const MissionId& mission, int from, int until) {
    std::vector<Range> rows;
    for (int i = from; i < until; ++i) rows.push_back(row(mission, i));
    return db_->stores().measurements.append_ranges(std::move(rows), false).value();
  }
  MissionId recorded() {
    const auto mission = stored_mission();
    EXPECT_THAT(append(mission.id, 0, k_ranges), Each(accepted));
    return mission.id;
  }
  MissionId landed() {
    const auto id = recorded();
    EXPECT_TRUE(db_->stores().missions.finish(id, k_landed));
    return id;
  }
  Result<std::vector<std::string>> read(const MissionId& mission) {
    MeasurementStore::Filter filter;
    filter.mission = mission;
    filter.with_cir = true;
    filter.limit = 100'000;
    BOOST_OUTCOME_TRY(const auto page, db_->stores().measurements.ranges(filter));
    std::vector<std::string> out;
    for (const auto& range : page.rows) out.push_back(text_of(range.cir));
    return out;
  }
  static std::vector<std::string> expected(int n = k_ranges) {
    std::vector<std::string> out;
    for (int i = 0; i < n; ++i) out.push_back(text_of(cir_of(i)));
    return out;
  }
  fs::path folder() const { return dir_.path() / "data" / "cir-archive"; }
  std::vector<std::string> files() const {
    std::vector<std::string> out;
    if (!fs::exists(folder())) return out;
    for (const auto& entry : fs::directory_iterator(folder()))
      out.push_back(entry.path().filename().string());
    std::ranges::sort(out);
    return out;
  }
  /// Ends, as a process that is killed does, when it is asked for the n-th time; true: it was not.
  bool survives(int n, const std::function<Result<ArchivedCirs>(Database&, const CirArchive::GoOn&)>& work) {
    db_.reset();
    Child child([&](int) {
      const auto db = GetParam().open(dir_.path() / "data");
      int asked = 0;
      const auto done = work(*db, [&] {
        if (++asked == n) ::raise(SIGKILL);
        return true;
      });
      return done ? 0 : 1;
    });
    const int code = child.wait();
    EXPECT_NE(code, 1);
    reopen();
    return code == 0;
  }
};

constexpr std::uint64_t k_cirs = k_ranges - k_ranges / 5;

TEST_P(CirArchiveContract, ReadsWhatWasMovedIntoAFileAsItWasMeasured) {
  const auto mission = landed();
  ASSERT_EQ(read(mission).value(), expected());
  const auto moved = archive().archive(mission, k_later, k_go_on);
  ASSERT_TRUE(moved) << moved.error().message;
  EXPECT_EQ(moved.value().n_cirs, k_cirs);
  EXPECT_EQ(moved.value().n_moved, k_cirs);
  EXPECT_THAT(files(), ElementsAre(to_string(mission) + "-1.db"));
  EXPECT_EQ(moved.value().file_bytes, fs::file_size(folder() / moved.value().file));
  EXPECT_THAT(moved.value().place, HasSubstr(folder().string()));
  EXPECT_EQ(read(mission).value(), expected());
  reopen();
  EXPECT_EQ(read(mission).value(), expected());
  EXPECT_EQ(archive().list().value().at(0).mission_name, "flight");

  MeasurementStore::Filter filter;
  filter.mission = mission;
  filter.limit = 8;
  const auto page = db_->stores().measurements.ranges(filter).value();
  EXPECT_EQ(text_of(db_->stores().measurements.range(page.ids[7]).value().cir), text_of(cir_of(7)));
  EXPECT_EQ(text_of(db_->stores().measurements.range(page.ids[5]).value().cir), "none");
  EXPECT_EQ(db_->stores().measurements.count_ranges(mission).value(), std::uint64_t{k_ranges});
}

TEST_P(CirArchiveContract, IsDueOnceForWhatLandedBefore) {
  const auto flying = recorded();
  const auto mission = landed();
  EXPECT_THAT(archive().due(k_landed, 10).value(), IsEmpty());
  EXPECT_THAT(archive().due(k_later, 10).value(), ElementsAre(mission));
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  EXPECT_THAT(archive().due(k_later, 10).value(), IsEmpty());
  const auto refused = archive().archive(flying, k_later, k_go_on);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::conflict);
  EXPECT_EQ(archive().archive(MissionId{make_uuid_v7(k_noon)}, k_later, k_go_on).error().code,
            Errc::not_found);
}

TEST_P(CirArchiveContract, GoesOnceThroughAFlightWithoutResponses) {
  const auto mission = stored_mission();
  ASSERT_TRUE(
      db_->stores().measurements.append_ranges({range_at(mission.id, 1), range_at(mission.id, 2)}, true));
  ASSERT_TRUE(db_->stores().missions.finish(mission.id, k_landed));
  ASSERT_THAT(archive().due(k_later, 10).value(), ElementsAre(mission.id));
  EXPECT_EQ(archive().archive(mission.id, k_later, k_go_on).value().n_cirs, 0u);
  EXPECT_THAT(archive().due(k_later, 10).value(), IsEmpty());
  EXPECT_THAT(archive().list().value(), IsEmpty());
  EXPECT_THAT(files(), IsEmpty());
}

TEST_P(CirArchiveContract, TakesRowsThatCameLateIntoTheNextFile) {
  const auto mission = landed();
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  ASSERT_THAT(append(mission, k_ranges, k_ranges + 10), Each(accepted));
  EXPECT_EQ(read(mission).value(), expected(k_ranges + 10));
  ASSERT_THAT(archive().due(k_later, 10).value(), ElementsAre(mission));
  const auto moved = archive().archive(mission, k_later, k_go_on).value();
  EXPECT_EQ(moved.n_cirs, k_cirs + 8);
  EXPECT_EQ(moved.n_moved, k_cirs + 8);
  EXPECT_THAT(files(), ElementsAre(to_string(mission) + "-2.db"));
  EXPECT_EQ(read(mission).value(), expected(k_ranges + 10));
}

TEST_P(CirArchiveContract, KnowsARepeatedRowWithoutItsFile) {
  const auto mission = landed();
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  fs::remove_all(folder());
  EXPECT_THAT(append(mission, 0, 20), Each(duplicate));
  Range other = row(mission, 1), without = row(mission, 2);
  other.cir->re_im[5] ^= 1;
  without.cir.reset();
  EXPECT_THAT(db_->stores().measurements.append_ranges({other, without}, false).value(),
              ElementsAre(conflict, conflict));
}

TEST_P(CirArchiveContract, SaysWhichFileIsMissingAndReadsOnWhenItIsBack) {
  const auto mission = landed();
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  fs::rename(folder(), dir_.path() / "elsewhere");
  const auto missing = read(mission);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, Errc::storage_unavailable);
  EXPECT_THAT(missing.error().message, HasSubstr(folder().string() + "/" + to_string(mission)));
  EXPECT_FALSE(archive().list().value().at(0).here);
  MeasurementStore::Filter filter;
  filter.mission = mission;
  EXPECT_EQ(db_->stores().measurements.ranges(filter).value().rows.size(), 100u);
  BundleRows rows;
  EXPECT_FALSE(db_->stores().bundles.write_out(mission, rows));
  EXPECT_FALSE(archive().bring_back(mission, k_go_on));
  fs::rename(dir_.path() / "elsewhere", folder());
  EXPECT_EQ(read(mission).value(), expected());
}

TEST_P(CirArchiveContract, GivesNothingOfADamagedFileForMeasured) {
  const auto mission = landed();
  const auto moved = archive().archive(mission, k_later, k_go_on).value();
  const auto file = folder() / moved.file;
  const auto size = static_cast<std::streamoff>(fs::file_size(file));
  int refused = 0;
  for (std::streamoff at = 4096; at < size; at += 4096) {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    const auto flip = [&] {
      bytes.seekg(at);
      const int was = bytes.get();
      bytes.seekp(at);
      bytes.put(static_cast<char>(was ^ 0x40));
      bytes.flush();
    };
    flip();
    const auto got = read(mission);
    if (got)
      EXPECT_EQ(got.value(), expected());  // a byte that nothing is in
    else
      ++refused;
    flip();
  }
  EXPECT_GT(refused, 10);
  EXPECT_EQ(read(mission).value(), expected());
}

TEST_P(CirArchiveContract, BringsBackWhatStaysThen) {
  const auto mission = landed();
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  const auto back = archive().bring_back(mission, k_go_on);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_TRUE(back.value().held);
  EXPECT_EQ(back.value().n_moved, 0u);
  EXPECT_THAT(archive().due(k_later, 10).value(), IsEmpty());
  fs::rename(folder(), dir_.path() / "elsewhere");
  EXPECT_EQ(read(mission).value(), expected());
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  EXPECT_FALSE(archive().list().value().at(0).held);
  EXPECT_EQ(read(mission).value(), expected());
}

TEST_P(CirArchiveContract, MakesTheSameBundleAndTakesItAsKnown) {
  const auto mission = landed();
  BundleRows before, after;
  ASSERT_TRUE(db_->stores().bundles.write_out(mission, before));
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  ASSERT_TRUE(db_->stores().bundles.write_out(mission, after));
  EXPECT_EQ(before.tables, after.tables);
  fs::remove_all(folder());
  const auto taken = db_->stores().bundles.take_in(mission, before);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_FALSE(taken.value().added());
  std::get<std::string>(before.tables["uwb_range"][1].back())[3] ^= 1;
  const auto other = db_->stores().bundles.take_in(mission, before);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, Errc::conflict);
}

TEST_P(CirArchiveContract, LosesNothingWhenItIsStoppedBeforeAnyStep) {
  const auto mission = landed();
  const auto until = [](int& left) { return [&left] { return left-- > 0; }; };
  int steps = 0;
  for (int n = 0;; ++n) {
    int left = n;
    const auto moved = archive().archive(mission, k_later, until(left));
    ASSERT_EQ(read(mission).value(), expected()) << "stopped at step " << n;
    if (moved) break;
    ASSERT_EQ(moved.error().code, Errc::canceled);
    ++steps;
  }
  EXPECT_GE(steps, 8);
  EXPECT_THAT(files(), testing::SizeIs(1));
  for (int n = 0;; ++n) {
    int left = n;
    const auto back = archive().bring_back(mission, until(left));
    ASSERT_EQ(read(mission).value(), expected()) << "stopped at step " << n;
    if (back) break;
    ASSERT_EQ(back.error().code, Errc::canceled);
  }
}

TEST_P(CirArchiveContract, LosesNothingWhenTheProcessIsKilledAtAnyStep) {
  const auto mission = landed();
  const auto move = [&](Database& db, const CirArchive::GoOn& go_on) {
    return db.cir_archive().archive(mission, k_later, go_on);
  };
  int kills = 0;
  for (int n = 1; !survives(n, move); ++n, ++kills)
    ASSERT_EQ(read(mission).value(), expected()) << "killed at step " << n;
  EXPECT_GE(kills, 8);
  EXPECT_THAT(files(), testing::SizeIs(1));
  EXPECT_EQ(read(mission).value(), expected());
  EXPECT_EQ(archive().list().value().at(0).n_moved, k_cirs);
  const auto back = [&](Database& db, const CirArchive::GoOn& go_on) {
    return db.cir_archive().bring_back(mission, go_on);
  };
  for (int n = 1; !survives(n, back); ++n)
    ASSERT_EQ(read(mission).value(), expected()) << "killed at step " << n << " on the way back";
  EXPECT_EQ(archive().list().value().at(0).n_moved, 0u);
  EXPECT_EQ(read(mission).value(), expected());
}

TEST_P(CirArchiveContract, LeavesWhatWasDeletedMeanwhile) {
  const auto mission = landed();
  const auto other = landed();
  int asked = 0;
  const auto moved = archive().archive(mission, k_later, [&] {
    const bool now = ++asked == 6;
    return !now || db_->stores().bin.put(mission, k_later, 0, "me").has_value();
  });
  ASSERT_FALSE(moved);
  EXPECT_EQ(moved.error().code, Errc::not_found);
  EXPECT_EQ(read(other).value(), expected());
  ASSERT_TRUE(db_->stores().bin.restore(mission));
  EXPECT_EQ(read(mission).value(), expected());
}

TEST_P(CirArchiveContract, DeletesTheFileOfAFlightThatIsRemovedForGood) {
  const auto mission = landed(), other = landed();
  ASSERT_TRUE(archive().archive(mission, k_later, k_go_on));
  ASSERT_TRUE(archive().archive(other, k_later, k_go_on));
  ASSERT_TRUE(db_->stores().bin.put(mission, k_later, 0, "me"));
  EXPECT_EQ(files().size(), 2u);
  EXPECT_EQ(archive().list().value().size(), 1u);
  ASSERT_TRUE(db_->stores().bin.empty(mission));
  while (db_->stores().bin.remove_rows(100).value() > 0) {
  }
  EXPECT_THAT(files(), ElementsAre(to_string(other) + "-1.db"));
  EXPECT_EQ(read(other).value(), expected());
}

INSTANTIATE_TEST_SUITE_P(Backends, CirArchiveContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::cir_archive_contract_test
