#include "api/calibration/kit_profile_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord {
namespace {

using Ordered = nlohmann::ordered_json;
constexpr const char* k_schema = "anchord.kit_profile/1";

Error wrong(const std::string& what) { return make_error(Errc::invalid_argument, "kit profile: " + what); }

Result<ProfileFactor> parse_factor(const Ordered& json, std::size_t index) {
  const std::string where = "factors[" + std::to_string(index) + "]";
  if (!json.is_object()) return wrong(where + " is not an object");
  for (const auto& [key, value] : json.items()) {
    if (key != "flight" && key != "digest" && key != "information" && key != "information_mean")
      return wrong(where + ": unknown key '" + key + "'");
  }
  ProfileFactor factor;
  if (json.contains("flight") && json["flight"].is_string())
    factor.flight = json["flight"].get<std::string>();
  if (json.contains("digest") && json["digest"].is_string())
    factor.digest = json["digest"].get<std::string>();
  const auto finite = [](const Ordered& v) { return v.is_number() && std::isfinite(v.get<double>()); };
  if (!json.contains("information") || !json["information"].is_array() || json["information"].size() != 16 ||
      !json.contains("information_mean") || !json["information_mean"].is_array() ||
      json["information_mean"].size() != 4) {
    return wrong(where + ": information needs 16 numbers, information_mean 4");
  }
  for (std::size_t i = 0; i < 16; ++i) {
    const Ordered& value = json["information"][i];
    if (!finite(value))
      return wrong(where + ".information[" + std::to_string(i) + "] is not a finite number");
    factor.information(static_cast<Eigen::Index>(i / 4), static_cast<Eigen::Index>(i % 4)) =
        value.get<double>();
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const Ordered& value = json["information_mean"][i];
    if (!finite(value))
      return wrong(where + ".information_mean[" + std::to_string(i) + "] is not a finite number");
    factor.information_mean[static_cast<Eigen::Index>(i)] = value.get<double>();
  }
  if (!factor.information.isApprox(factor.information.transpose(), 1e-6))
    return wrong(where + ".information is not symmetric");
  return factor;
}

}  // namespace

std::string kit_profile_json(const KitProfile& profile) {
  Ordered json = {{"schema", k_schema},
                  {"kit", profile.kit},
                  {"order", {"bias_m", "curve_m_per_efold", "lag_s", "lever_up_m"}},
                  {"factors", Ordered::array()}};
  for (const auto& factor : profile.factors) {
    Ordered one = {{"flight", factor.flight}};
    if (!factor.digest.empty()) one["digest"] = factor.digest;
    one["information"] = Ordered::array();
    one["information_mean"] = Ordered::array();
    for (Eigen::Index r = 0; r < 4; ++r) {
      for (Eigen::Index c = 0; c < 4; ++c) one["information"].push_back(factor.information(r, c));
      one["information_mean"].push_back(factor.information_mean[r]);
    }
    json["factors"].push_back(std::move(one));
  }
  return to_wire(json, 1) + "\n";
}

Result<KitProfile> parse_kit_profile(std::string_view text) {
  const Ordered json = Ordered::parse(text, nullptr, false);
  if (json.is_discarded() || !json.is_object()) return wrong("not a JSON object");
  for (const auto& [key, value] : json.items()) {
    if (key != "schema" && key != "kit" && key != "order" && key != "factors")
      return wrong("unknown key '" + key + "'");
  }
  if (!json.contains("schema") || json["schema"] != k_schema)
    return wrong(std::string("schema is not ") + k_schema);
  if (!json.contains("kit") || !json["kit"].is_string()) return wrong("kit is missing");
  if (!json.contains("factors") || !json["factors"].is_array()) return wrong("factors is not a list");
  KitProfile profile;
  profile.kit = json["kit"].get<std::string>();
  for (std::size_t i = 0; i < json["factors"].size(); ++i) {
    BOOST_OUTCOME_TRY(auto factor, parse_factor(json["factors"][i], i));
    profile.factors.push_back(std::move(factor));
  }
  return profile;
}

}  // namespace anchord
