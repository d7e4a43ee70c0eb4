#pragma once

#include <cstdint>
#include <string_view>

#include "core/base/enum_table.hpp"

namespace anchord {

/// How much an entry of the event log asks of its reader.
enum class EventLevel : std::uint8_t { info, warning, critical };
inline constexpr auto k_event_level_words = enum_table<EventLevel>(
    {{"info", EventLevel::info}, {"warning", EventLevel::warning}, {"critical", EventLevel::critical}});
constexpr std::string_view to_string(EventLevel level) { return k_event_level_words.word(level); }

}  // namespace anchord
