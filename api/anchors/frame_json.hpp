#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/base/enum_table.hpp"
#include "core/geo/frame_fit.hpp"
#include "core/types/local_frame.hpp"
#include "core/types/position.hpp"

namespace anchord::api {

/// What the numbers of POST /transform are.
enum class Space : std::uint8_t { geo, enu, projected, local, crs };
inline constexpr auto k_space_words = enum_table<Space>({{"geo", Space::geo},
                                                         {"enu", Space::enu},
                                                         {"projected", Space::projected},
                                                         {"local", Space::local},
                                                         {"crs", Space::crs}});

/// What LocalFrame::definition holds once a frame was fitted.
struct FrameDefinition {
  Wgs84 origin{};  ///< of the ENU numbers
  std::vector<FramePair> pairs;
  FrameFit fit;
  UtcTime fitted{};
};

nlohmann::ordered_json frame_fit_json(const FrameFit& fit, const std::vector<FramePair>& pairs);
std::string frame_definition_json(const FrameDefinition& definition);
/// Nothing for a frame that was never fitted.
std::optional<FrameDefinition> frame_definition(const LocalFrame& frame);
nlohmann::ordered_json frame_json(const LocalFrame& frame);

/// A pair as sent: a place on the globe, or an anchor whose published position is meant.
struct PairRequest {
  FramePair pair;
  std::optional<Wgs84> wgs84{};
  std::optional<NetworkId> anchor{};
};
struct FitRequest {
  FrameFitOptions options;
  std::vector<PairRequest> pairs;
};
FitRequest read_fit_request(const nlohmann::json& body, std::vector<FieldError>& errors);

}  // namespace anchord::api
