#pragma once

#include <cstddef>
#include <stop_token>
#include <string>
#include <string_view>

#include "api/calibration/calibration_record.hpp"
#include "api/calibration/calibration_task.hpp"
#include "api/work/worker_port.hpp"
#include "core/base/result.hpp"

/// A calibration as work for another process: the task as a message of text, its answer as another. A message
/// is a line of JSON, {"kind": "calibration", "version": ...}, then packed bytes; both sides have one
/// version.
namespace anchord::api {

/// What is larger is solved by the server itself: some 600 000 ranges. A flight of 60 000 ranges and 12 000
/// positions is 2 MB.
inline constexpr std::size_t k_most_message_bytes = std::size_t{16} << 20;
/// Of an answer, unpacked; the anchors of all flights together, 1 700 or more.
inline constexpr std::size_t k_most_answer_bytes = std::size_t{256} << 20;

std::string calibration_message(const CalibrationTask& task);
/// Whether a message is one of these.
bool is_calibration_work(std::string_view message);
/// What the worker process does. Pure: no store, no socket.
/// errors  bad_frame (the message), those of solve_calibration
Result<std::string> do_calibration_work(std::string_view message, const std::stop_token& stop,
                                        const WorkProgressSink& progress);

/// How many bytes an answer to this may have.
std::size_t answer_bytes(const CalibrationOrder& order);
std::string answer_text(const CalibrationAnswer& answer);
/// Reads an answer as what a stranger sends: bounded, every number finite, and of what was asked.
/// errors  bad_frame, naming what is wrong
Result<CalibrationAnswer> read_answer(const CalibrationOrder& order, std::string_view text);

/// An order as kept with its job, and back. errors: bad_frame
std::string order_text(const CalibrationOrder& order);
Result<CalibrationOrder> read_order(std::string_view text);

/// For what is packed here and for its tests.
Result<CalibrationTask> read_task(std::string_view message);

}  // namespace anchord::api
