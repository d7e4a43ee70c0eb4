#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/enum_table.hpp"
#include "drivers/link/byte_link.hpp"

namespace anchord::record {

/// Everything that ever decides what a driver does. In order of arrival over all devices; the same events
/// give the same rows.
enum class EventKind : std::uint8_t {
  added = 1,  ///< payload: device::Settings as JSON; makes a new driver for the slot
  removed = 2,
  opened = 3,
  bytes = 4,  ///< payload: as received
  tick = 5,   ///< the driver's deadline passed
  closed = 6,
  command = 7,  ///< payload: device::Command as JSON
  mission = 8,  ///< slot 0; payload: id of the mission that records from here on, empty: none
};
inline constexpr auto k_event_kind_words = enum_table<EventKind>({{"added", EventKind::added},
                                                                  {"removed", EventKind::removed},
                                                                  {"opened", EventKind::opened},
                                                                  {"bytes", EventKind::bytes},
                                                                  {"tick", EventKind::tick},
                                                                  {"closed", EventKind::closed},
                                                                  {"command", EventKind::command},
                                                                  {"mission", EventKind::mission}});

struct Event {
  EventKind kind{EventKind::bytes};
  std::uint16_t slot{};
  link::Arrival at{};
  std::string_view payload{};
};

/// docs/formats.md, "Raw recording". A file: magic, then records of
///   u32 length of the body, u32 CRC-32C of the body, body;  all little endian
///   body: u8 kind, u16 slot, i64 steady ns, i64 UTC ns, payload
inline constexpr std::string_view k_magic{"ANCHREC1", 8};
inline constexpr std::size_t k_record_head = 8, k_body_head = 19;
inline constexpr std::size_t k_max_payload = 1 << 20;  ///< links read 64 KiB at most; commands are smaller

std::uint32_t crc32c(std::string_view bytes);
void append_record(std::string& out, const Event& event);

/// Records of one file's bytes, until its end or the first that is torn or damaged.
class EventReader {
 public:
  explicit EventReader(std::string_view file) : rest_(file) {}
  /// False: this is no recording.
  bool begin();
  /// The payload points into the file.
  std::optional<Event> next();
  std::size_t left() const { return rest_.size(); }  ///< bytes behind the last good record

 private:
  std::string_view rest_;
};

}  // namespace anchord::record
