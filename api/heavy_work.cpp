#include "api/heavy_work.hpp"

#include "api/calibration/calibration_work.hpp"
#include "api/learning/training_work.hpp"

namespace anchord::api {

Result<std::string> do_work(std::string_view message, const std::stop_token& stop,
                            const WorkProgressSink& progress) {
  return is_calibration_work(message) ? do_calibration_work(message, stop, progress)
                                      : do_training_work(message, stop, progress);
}

Result<std::string> work_inline(const std::string& message, const WorkProgressSink& progress,
                                const std::function<bool()>& canceled) {
  std::stop_source stop;
  return do_work(message, stop.get_token(), [&](const WorkProgress& p) {
    if (canceled()) stop.request_stop();
    progress(p);
  });
}

}  // namespace anchord::api
