#include "api/formats/foreign_tags.hpp"

#include <algorithm>
#include <set>

namespace anchord::api {
namespace {

std::set<NetworkId> addresses_of(const std::vector<Range>& ranges, NetworkId Range::*of) {
  std::set<NetworkId> out;
  for (const auto& range : ranges)
    if (range.kind == RangeKind::tag_anchor) out.insert(range.*of);
  return out;
}

std::string shown(const std::set<NetworkId>& addresses) {
  constexpr std::size_t k_most_tags = 8;
  std::string out;
  std::size_t n = 0;
  for (const auto id : addresses) {
    if (n++ < k_most_tags) out += (out.empty() ? "" : ", ") + to_string(id);
  }
  return out + (n > k_most_tags ? " and " + std::to_string(n - k_most_tags) + " more" : "");
}

}  // namespace

Result<TagArms> arms_of(const ForeignOptions& options, AddressKind addresses) {
  TagArms out;
  for (const auto& [tag, arm_m] : options.lever_arms_body_m)
    if (!out.emplace(foreign_id(tag, addresses).id, arm_m).second)
      return make_error(Errc::invalid_argument, "lever-arm: tag " + tag + " has two");
  return out;
}

Result<void> check_arms(const TagArms& arms, const ForeignOptions& options,
                        const std::vector<Range>& ranges) {
  if (arms.empty()) return boost::outcome_v2::success();
  const auto tags = addresses_of(ranges, &Range::tag);
  for (const auto& [tag, arm_m] : arms)
    if (!tags.contains(tag))
      return make_error(Errc::invalid_argument, "--lever-arm of " + to_string(tag) +
                                                    ": no range is of that tag (tags: " + shown(tags) + ')');
  if (!options.lever_arm_body_m.isZero(0)) return boost::outcome_v2::success();
  for (const auto tag : tags)
    if (!arms.contains(tag))
      return make_error(
          Errc::invalid_argument,
          "tag " + to_string(tag) + " has no lever arm, other tags have: --lever-arm " + to_string(tag) +
              "=FORWARD,LEFT,UP, or one without a tag for all others; an anchor that measured ranges "
              "to other anchors is no tag: kind anchor_anchor, or leave its rows out");
  return boost::outcome_v2::success();
}

void note_tags(const std::string& table, const TagArms& arms, const std::vector<Range>& ranges,
               std::vector<std::string>& notes_out) {
  const auto tags = addresses_of(ranges, &Range::tag), anchors = addresses_of(ranges, &Range::anchor);
  if (tags.size() > 1 && arms.empty())
    notes_out.push_back(
        "warning: " + table + ": " + std::to_string(tags.size()) + " tags (" + shown(tags) +
        ") have one lever arm, and cannot be in one place: --lever-arm TAG=FORWARD,LEFT,UP for each");
  std::set<NetworkId> both;
  std::ranges::set_intersection(tags, anchors, std::inserter(both, both.end()));
  if (!both.empty())
    notes_out.push_back(
        "warning: " + table + ": " + shown(both) +
        " is tag of some ranges and anchor of others; where the anchor began the exchange, tag and "
        "anchor are exchanged: --lever-arm TAG=FORWARD,LEFT,UP names the tags, and such ranges are "
        "turned round; ranges between anchors have kind anchor_anchor");
}

}  // namespace anchord::api
