#include "api/formats/cir_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "api/formats/cells.hpp"
#include "api/formats/csv_record.hpp"
#include "api/formats/gzip_lines.hpp"

namespace anchord::api {

namespace {
constexpr std::array<std::string_view, 3> k_joins{"setup", "idx", "seq"};
}

std::string joined(const std::vector<std::string_view>& cells, std::span<const std::size_t> columns) {
  std::string out;
  for (const auto c : columns) out.append(out.empty() ? "" : "/").append(cells[c]);
  return out;
}

Result<CirTable> read_cir(const std::filesystem::path& path) {
  BOOST_OUTCOME_TRY(auto lines, GzipLines::open(path));
  const auto fault = [&](const std::string& what) {
    return make_error(Errc::bad_frame,
                      path.string() + ":" + std::to_string(lines.line_number()) + ": " + what);
  };
  CirTable out;
  std::vector<std::size_t> joins;
  std::vector<std::pair<std::size_t, std::size_t>> taps;
  CsvRecord record;
  std::vector<float> magnitude;
  std::size_t width = 0;
  for (std::string_view line;;) {
    BOOST_OUTCOME_TRY(const bool more, lines.next(line));
    if (!more) break;
    if (const auto read = record.read(line); !read) return fault(read.error().message);
    const auto& cells = record.cells();
    if (width == 0) {
      width = cells.size();
      for (std::size_t c = 0; c < width; ++c) {
        if (std::find(k_joins.begin(), k_joins.end(), cells[c]) != k_joins.end()) {
          joins.push_back(c);
          out.join_names.emplace_back(cells[c]);
        } else if (cells[c].size() > 1 && cells[c][0] == 'm' && cell_number(cells[c].substr(1)))
          taps.emplace_back(static_cast<std::size_t>(*cell_number(cells[c].substr(1))), c);
      }
      std::sort(taps.begin(), taps.end());
      if (joins.empty() || taps.size() < 32)
        return make_error(
            Errc::invalid_argument,
            path.string() + ": a CIR table needs a join column (setup, idx, seq) and taps m0, m1, ...");
      continue;
    }
    if (cells.size() != width)
      return fault(std::to_string(cells.size()) + " cells, the header has " + std::to_string(width));
    magnitude.clear();
    for (const auto& [tap, column] : taps)
      magnitude.push_back(
          static_cast<float>(cell_number(cells[column]).value_or(std::numeric_limits<double>::quiet_NaN())));
    if (std::any_of(magnitude.begin(), magnitude.end(), [](float v) { return std::isnan(v); })) continue;
    out.taps.emplace(joined(cells, joins), magnitude);
  }
  return out;
}

}  // namespace anchord::api
