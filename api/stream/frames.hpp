#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "api/stream/hub.hpp"

namespace anchord::api {

/// {"op":"data",...}. `as_array`: streams always carry an array; otherwise one element stands alone.
std::shared_ptr<const std::string> data_frame(std::uint64_t sub, std::uint64_t seq, std::uint64_t prev,
                                              std::int64_t t_us, const std::vector<LiveElement>& elements,
                                              bool as_array, std::uint64_t conflated);
std::string snap_frame(std::uint64_t sub, std::uint64_t seq, std::int64_t t_us,
                       const std::vector<LiveElement>& elements, bool as_array);
std::string gap_frame(std::uint64_t sub, std::uint64_t from_seq, std::uint64_t to_seq, std::uint64_t dropped);
std::string heartbeat_frame(std::int64_t t_us, double queue, bool conflating);
std::string bye_frame(std::uint16_t code, std::string_view reason);

}  // namespace anchord::api
