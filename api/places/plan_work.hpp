#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "api/work/worker_port.hpp"
#include "core/floor_plan/georeference.hpp"
#include "core/floor_plan/tiles.hpp"
#include "core/types/place.hpp"

namespace anchord {
class SteadyClock;
}

/// Work on pictures of plans in the worker process: a line of JSON with the task, then the picture's bytes.
namespace anchord::api {

/// Dots per inch that a PDF page is drawn with: a wall of 10 cm at 1:200 is 4 pixels thick.
inline constexpr double k_plan_dpi = 200, k_min_plan_dpi = 50, k_max_plan_dpi = 600;

/// Processor time that a picture may take of its worker, and again of the programs that the worker runs: one
/// that takes more was made for that. 100 million pixels of noise take 6 s, their tracing 19 s.
inline constexpr int k_picture_cpu_s = 30, k_tiles_cpu_s = 60, k_trace_cpu_s = 120;
/// Until work is given up that others leave no processor for: a worker is below them in rank.
inline constexpr double k_plan_work_s = 600;

/// What is asked of the worker.
enum class PlanTask : std::uint8_t {
  inspect,   ///< {width_px, height_px, preview}: decoded whole once, so that a broken file is refused at once
  backdrop,  ///< {low_m, high_m, width_px, height_px, png}
  tiles,     ///< ask_for_tiles
  trace,     ///< {outline_m, walls, cell_m, notes}
  draw,      ///< {png, drawing_m_from_pixel, is_at_site}: of a DXF
  page,      ///< {png, pages}: of a PDF
};

struct PlanQuestion {
  PlanTask task{PlanTask::inspect};
  floor_plan::PlanTransform transform{};        ///< backdrop, tiles, trace
  std::optional<Eigen::Vector2d> site_map_m{};  ///< draw: easting and northing of the site in its map system
  int page{1};                                  ///< page
  double dots_per_inch{k_plan_dpi};             ///< page: of paper, at most
  int cpu_s() const {
    return task == PlanTask::trace   ? k_trace_cpu_s
           : task == PlanTask::tiles ? k_tiles_cpu_s
                                     : k_picture_cpu_s;
  }
};

/// The longest side of previews, and the most bytes of previews and backdrops.
inline constexpr int k_preview_px = 2400, k_backdrop_px = 4096;
inline constexpr std::size_t k_max_picture_bytes = std::size_t{8} << 20;
/// Runs a program, with these bytes as its standard input: what it printed.
/// errors: unsupported (it is not installed), bad_frame (it failed, with its words), invalid_argument (it
/// printed more than max_output), no_convergence (it used up the processor time of the work)
using RunProgram = std::function<Result<std::string>(const std::vector<std::string>& command,
                                                     std::string_view input, std::size_t max_output)>;

/// Whether a message is one of these; else it is do_work's.
bool is_plan_work(std::string_view message);
/// Whether it is one that needs a program (task page).
bool is_page_work(std::string_view message);
/// The processor time it may take.
int plan_work_cpu_s(std::string_view message);
/// The answer to a picture that took more.
Error too_busy(int cpu_s);
/// Does it, on the calling thread. errors: those of decode_image, make_backdrop, trace_plan, read_dxf,
/// draw_plan, read_pdf_info, RunProgram; bad_frame
Result<std::string> do_plan_work(std::string_view message, const std::stop_token& stop,
                                 const WorkProgressSink& progress, const RunProgram& run_program);
/// do_plan_work on the calling thread, as a RunWork; without programs.
Result<std::string> plan_work_inline(const std::string& message, const WorkProgressSink& progress,
                                     const std::function<bool()>& canceled);

/// Has it done by `run`, and reads the answer as what a stranger sends.
/// errors  those of the work; no_convergence (too_busy, or longer than k_plan_work_s), canceled
Result<nlohmann::json> ask_worker(const RunWork& run, const SteadyClock& steady, const PlanQuestion& question,
                                  std::string_view picture, const WorkProgressSink& progress,
                                  const std::function<bool()>& canceled);

inline std::int64_t tile_columns(const PlanTiles& tiles, int level) {
  return floor_plan::tiles_across(tiles.width_px, tiles.n_levels, level);
}
inline std::int64_t tile_rows(const PlanTiles& tiles, int level) {
  return floor_plan::tiles_across(tiles.height_px, tiles.n_levels, level);
}
/// Whether the plan has such a level, column and row.
bool is_tile_of(const PlanTiles& tiles, int level, int column, int row);

/// Tiles as the worker made them; `what` has no id yet.
struct MadeTiles {
  PlanTiles what;
  std::string answer;              ///< holds the bytes of the pictures
  std::vector<PlanTile> pictures;  ///< into `answer`
};
/// As ask_worker, for the tiles of a plan: their bytes come as they are, behind a line of JSON.
Result<MadeTiles> ask_for_tiles(const RunWork& run, const SteadyClock& steady,
                                const floor_plan::PlanTransform& transform, std::string_view picture);

}  // namespace anchord::api
