// One row of a bulk upload from its text, all checks included: read straight, and through a document as rows
// with something wrong are. One row of an export: straight into its text, and through a document.
#include <benchmark/benchmark.h>

#include <nlohmann/json.hpp>
#include <string>

#include "api/kit/reader.hpp"
#include "api/wire/row_parser.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/base64.hpp"
#include "core/base/to_wire.hpp"

namespace {

using namespace anchord;

const MissionId k_mission{parse_uuid("0197a3b0-1111-7222-8333-444455556666").value()};

std::string row(bool with_cir) {
  std::string text =
      R"({"t_us":1777889472345678,"tag":"0x6e01","anchor":"0x6a2f","distance_m":7.412,"rss_dbm":-84.3,)"
      R"("fp_dbm":-86.1,"rx_dbm":-82.7,"std_noise":52,"heading_deg":120.5,"pose":{"lon":3.7131,"lat":51.0231,)"
      R"("h_m":61.4,"fix":"fixed","sigma_m":[0.012,0.011,0.021]},"truth":{"distance_m":7.35,"los":true},)"
      R"("seq":88123)";
  if (with_cir) {
    std::string bytes(1016 * 4, '\0');
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 2654435761U >> 24U);
    text += R"(,"cir":{"n":1016,"first_path_idx":744.2,"rxpacc":1001,"b64":")" + base64(bytes) + "\"}";
  }
  return text + '}';
}

void row_read_straight(benchmark::State& state) {
  const std::string text = row(state.range(0) != 0);
  api::RowParser parser;
  for (auto _ : state) benchmark::DoNotOptimize(parser.range(text, k_mission));
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * text.size()));
}
BENCHMARK(row_read_straight)->ArgName("cir")->Arg(0)->Arg(1);

void row_read_through_a_document(benchmark::State& state) {
  const std::string text = row(state.range(0) != 0);
  for (auto _ : state) {
    nlohmann::json value;
    std::vector<api::FieldError> errors;
    if (api::parse_json(text, value)) state.SkipWithError("not JSON");
    benchmark::DoNotOptimize(api::read_range(value, k_mission, errors));
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * text.size()));
}
BENCHMARK(row_read_through_a_document)->ArgName("cir")->Arg(0)->Arg(1);

Range stored() {
  api::RowParser parser;
  return parser.range(row(false), k_mission)->range;
}

void row_written_straight(benchmark::State& state) {
  const Range range = stored();
  std::string out;
  for (auto _ : state) {
    out.clear();
    api::append_range(out, range, 4711, false, {});
    benchmark::DoNotOptimize(out);
  }
}
BENCHMARK(row_written_straight);

void row_written_through_a_document(benchmark::State& state) {
  const Range range = stored();
  for (auto _ : state) benchmark::DoNotOptimize(to_wire(api::range_json(range, 4711)));
}
BENCHMARK(row_written_through_a_document);

}  // namespace
