#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "api/learning/worker_port.hpp"
#include "core/floor_plan/georeference.hpp"

namespace anchord {
class SteadyClock;
}

/// Work on pictures of plans in the worker process: a line of JSON with the task, then the picture's bytes.
namespace anchord::api {

/// What is asked of the worker.
enum class PlanTask : std::uint8_t {
  inspect,   ///< {width_px, height_px, preview}: decoded whole once, so that a broken file is refused at once
  backdrop,  ///< {low_m, high_m, width_px, height_px, png}
  trace,     ///< {outline_m, walls, cell_m, notes}
  draw,      ///< {png, drawing_m_from_pixel, is_at_site}: of a DXF
};

struct PlanQuestion {
  PlanTask task{PlanTask::inspect};
  floor_plan::PlanTransform transform{};        ///< backdrop, trace
  std::optional<Eigen::Vector2d> site_map_m{};  ///< draw: easting and northing of the site in its map system
};

/// The longest side of previews, and the most bytes of previews and backdrops.
inline constexpr int k_preview_px = 2400, k_backdrop_px = 4096;
inline constexpr std::size_t k_max_picture_bytes = std::size_t{8} << 20;
/// A picture that keeps a decoder longer was made for that.
inline constexpr double k_plan_work_s = 120;

/// Whether a message is one of these; else it is do_work's.
bool is_plan_work(std::string_view message);
/// Does it, on the calling thread. errors: those of decode_image, make_backdrop, trace_plan, read_dxf,
/// draw_plan; bad_frame
Result<std::string> do_plan_work(std::string_view message, const std::stop_token& stop,
                                 const WorkProgressSink& progress);
/// do_plan_work on the calling thread, as a RunWork.
Result<std::string> plan_work_inline(const std::string& message, const WorkProgressSink& progress,
                                     const std::function<bool()>& canceled);

/// Has it done by `run`, and reads the answer as what a stranger sends.
/// errors  those of the work; no_convergence (it took longer than k_plan_work_s), canceled
Result<nlohmann::json> ask_worker(const RunWork& run, const SteadyClock& steady, const PlanQuestion& question,
                                  std::string_view picture, const WorkProgressSink& progress,
                                  const std::function<bool()>& canceled);

}  // namespace anchord::api
