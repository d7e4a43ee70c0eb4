#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord {

/// 128-bit identifier, RFC 9562. anchord makes version 7, so that ids sort by creation.
struct Uuid {
  std::array<std::uint8_t, 16> bytes{};
  auto operator<=>(const Uuid&) const = default;
};

/// Version 7 from a time and the operating system's random bits. Of ids that one program makes of one
/// millisecond the later is the greater (RFC 9562 section 6.2, method 2).
Uuid make_uuid_v7(UtcTime now);
/// Lower-case canonical form, 36 characters.
std::string to_string(const Uuid& id);
/// Accepts either case; refuses anything but the canonical 36 characters.
Result<Uuid> parse_uuid(std::string_view text);

/// Distinct identifier types: passing a MissionId for an AnchorId does not compile.
template <class Tag>
struct Id {
  Uuid uuid{};
  auto operator<=>(const Id&) const = default;
};
template <class Tag>
std::string to_string(const Id<Tag>& id) {
  return to_string(id.uuid);
}

using SiteId = Id<struct SiteTag>;
using MissionId = Id<struct MissionTag>;
using AnchorId = Id<struct AnchorTag>;
using CalibrationId = Id<struct CalibrationTag>;
using CampaignId = Id<struct CampaignTag>;
using DatasetId = Id<struct DatasetTag>;
using TrainingRunId = Id<struct TrainingRunTag>;
using ModelId = Id<struct ModelTag>;
using FrameId = Id<struct FrameTag>;
using JobId = Id<struct JobTag>;
using TokenId = Id<struct TokenTag>;

/// Radio address of a UWB device, written "0x6a2f" (lower case, at least four digits).
struct NetworkId {
  std::uint32_t value{};
  auto operator<=>(const NetworkId&) const = default;
};
std::string to_string(NetworkId id);
/// Accepts "0x6a2f" and plain decimal ("101"), as flight folders have them.
Result<NetworkId> parse_network_id(std::string_view text);

}  // namespace anchord
