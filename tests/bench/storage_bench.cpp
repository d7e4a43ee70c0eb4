// What a commit costs and how many rows a second it carries, on the real file with the default settings.
#include <benchmark/benchmark.h>

#include <stdexcept>

#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "server/storage/sqlite_database.hpp"
#include "tests/scratch_dir.hpp"

namespace {

using namespace anchord;

struct Bench {
  explicit Bench(Synchronous synchronous) {
    StorageOptions options;
    options.data_dir = dir.path() / "data";
    options.reserve_bytes = 0;
    options.synchronous = synchronous;
    db = std::move(open_database(options)).value();
    mission.id = MissionId{make_uuid_v7(UtcTime{1})};
    if (!db->stores().missions.insert(mission)) throw std::runtime_error("no mission");
  }
  std::vector<Range> rows(std::int64_t n, bool with_cir) {
    std::vector<Range> made(static_cast<std::size_t>(n));
    for (Range& row : made) {
      row.mission = mission.id;
      row.time = UtcTime::from_us(1'777'889'472'000'000 + 1000 * next);
      row.tag = NetworkId{0x6e01};
      row.anchor = NetworkId{static_cast<std::uint32_t>(0x100 + next % 8)};
      row.seq = static_cast<std::uint64_t>(next++);
      row.distance_m = 7.4;
      row.rss_dbm = -84.3;
      row.fp_dbm = -86.1;
      if (with_cir) row.cir = Cir{std::vector<std::int16_t>(2032, 17), 1001.6, 744.2, 1001};
    }
    return made;
  }
  ScratchDir dir;
  std::unique_ptr<Database> db;
  Mission mission;
  std::int64_t next{0};
};

void append(benchmark::State& state, Synchronous synchronous, bool with_cir) {
  Bench bench(synchronous);
  for (auto _ : state) {
    state.PauseTiming();
    auto rows = bench.rows(state.range(0), with_cir);
    state.ResumeTiming();
    if (!bench.db->stores().measurements.append_ranges(std::move(rows), false))
      throw std::runtime_error("append");
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

void append_full(benchmark::State& state) { append(state, Synchronous::full, false); }
void append_normal(benchmark::State& state) { append(state, Synchronous::normal, false); }
void append_with_cir(benchmark::State& state) { append(state, Synchronous::full, true); }
BENCHMARK(append_full)
    ->Arg(1)
    ->Arg(50)
    ->Arg(1000)
    ->Arg(10000)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(append_normal)
    ->Arg(1)
    ->Arg(1000)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(append_with_cir)->Arg(1000)->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);

void append_duplicates(benchmark::State& state) {
  Bench bench(Synchronous::full);
  const auto rows = bench.rows(1000, false);
  if (!bench.db->stores().measurements.append_ranges(rows, false)) throw std::runtime_error("append");
  for (auto _ : state) benchmark::DoNotOptimize(bench.db->stores().measurements.append_ranges(rows, false));
  state.SetItemsProcessed(state.iterations() * 1000);
}
BENCHMARK(append_duplicates)->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);

void read_mission(benchmark::State& state) {
  Bench bench(Synchronous::normal);
  constexpr std::int64_t k_rows = 100'000;
  for (int i = 0; i < 10; ++i) {
    if (!bench.db->stores().measurements.append_ranges(bench.rows(k_rows / 10, false), false))
      throw std::runtime_error("append");
  }
  for (auto _ : state) {
    MeasurementStore::Filter filter;
    filter.mission = bench.mission.id;
    filter.limit = 10'000;
    std::int64_t n = 0;
    do {
      auto page = bench.db->stores().measurements.ranges(filter).value();
      n += static_cast<std::int64_t>(page.rows.size());
      filter.after = page.next;
    } while (!filter.after.empty());
    if (n != k_rows) throw std::runtime_error("rows missing");
  }
  state.SetItemsProcessed(state.iterations() * k_rows);
}
BENCHMARK(read_mission)->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
