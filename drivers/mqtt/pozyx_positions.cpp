#include "drivers/mqtt/pozyx_positions.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "drivers/mapping/decoder.hpp"
#include "drivers/time/time_base.hpp"

namespace anchord::mqtt {
namespace {

using Json = nlohmann::json;

constexpr std::size_t k_most_tags = 1000, k_most_id = 40;
constexpr double k_most_mm = 1e8;  ///< 100 km
constexpr double k_since_2015_s = 1'420'070'400, k_ahead_s = 3600;

const Json* member(const Json& object, const char* name) {
  if (!object.is_object()) return nullptr;
  const auto at = object.find(name);
  return at == object.end() ? nullptr : &*at;
}
std::optional<double> number(const Json* object, const char* name) {
  const Json* value = object == nullptr ? nullptr : member(*object, name);
  if (value == nullptr || !value->is_number() || !std::isfinite(value->get<double>())) return std::nullopt;
  return value->get<double>();
}

}  // namespace

void PozyxPositions::message(std::string_view text, const device::Arrival& at) {
  if (text.size() > mapping::Decoder::k_most_bytes) return out_.dropped("too_large");
  if (!is_utf8(text)) return out_.dropped("not_utf8");
  if (mapping::too_deep(text, mapping::Decoder::k_most_depth)) return out_.dropped("too_deep");
  const Json updates = Json::parse(text.begin(), text.end(), nullptr, false);
  if (!updates.is_array()) return out_.dropped("not_json");
  const double now_s = static_cast<double>(out_.time().utc_of(at.steady_ns).time.us()) * 1e-6;
  for (const auto& update : updates) {
    const Json* tag = member(update, "tagId");
    const Json* success = member(update, "success");
    const auto time_s = number(&update, "timestamp");
    if (tag == nullptr || !tag->is_string() || tag->get_ref<const std::string&>().size() > k_most_id ||
        !time_s) {
      out_.dropped("bad_update");
      continue;
    }
    if (success != nullptr && *success == false) {
      out_.heard();  // the gateway is there; it could not place the tag
      out_.dropped("failed");
      continue;
    }
    const Json* data = member(update, "data");
    const Json* where = data == nullptr ? nullptr : member(*data, "coordinates");
    const auto x = number(where, "x"), y = number(where, "y"), z = number(where, "z");
    const auto far = [](double mm) { return std::abs(mm) > k_most_mm; };
    if (!x || !y || !z || far(*x) || far(*y) || far(*z)) {
      out_.dropped("bad_update");
      continue;
    }
    if (*time_s < k_since_2015_s || *time_s > now_s + k_ahead_s) {
      out_.dropped("time_not_set");
      continue;
    }
    const auto& id = tag->get_ref<const std::string&>();
    if (!newest_.contains(id) && newest_.size() >= k_most_tags) {
      out_.dropped("too_many_tags");
      continue;
    }
    out_.heard();
    Position position{static_cast<std::int64_t>(*time_s * 1e6), *x * 1e-3, *y * 1e-3, *z * 1e-3, {}, 0};
    if (const auto yaw = number(member(*data, "orientation"), "yaw"))
      position.yaw_deg = *yaw * 180 / std::numbers::pi;
    if (const Json* anchors = member(*data, "anchorData"); anchors != nullptr && anchors->is_array())
      position.anchors = anchors->size();
    auto& newest = newest_[id];
    if (position.t_us >= newest.t_us) newest = position;  // batches are not in order
  }
}

std::string PozyxPositions::json() const {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (const auto& [id, p] : newest_) {
    out.push_back(
        {{"tag", id},
         {"t_us", p.t_us},
         {"local_m", {p.x_m, p.y_m, p.z_m}},
         {"yaw_deg", p.yaw_deg ? nlohmann::ordered_json(*p.yaw_deg) : nlohmann::ordered_json(nullptr)},
         {"anchors", p.anchors}});
  }
  return to_wire(out);
}

}  // namespace anchord::mqtt
