// Mission and fence lists of a Session: MISSION_COUNT, MISSION_REQUEST_INT, MISSION_ITEM_INT, MISSION_ACK.
#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/drone/session.hpp"

namespace anchord::drone {
namespace {

using mavlink::Message;

constexpr double k_wait_s = 1.5;
constexpr int k_transfer_tries = 5;
constexpr std::uint8_t k_same_item = 10;  // with a third of the frames lost, once in 5000 transfers
constexpr std::size_t k_max_items = 1000;

// MAV_CMD and MAV_FRAME of the common set.
constexpr int k_waypoint = 16, k_fence_inside = 5001, k_fence_outside = 5002;
constexpr int k_global = 0, k_above_home = 6;
constexpr int k_all_lists = 255;  // MAV_MISSION_TYPE_ALL

std::string list_word(ItemList list) { return list == ItemList::fence ? "fence" : "mission"; }

std::int32_t e7(double degrees) { return static_cast<std::int32_t>(std::llround(degrees * 1e7)); }

MissionItem place(int command, int frame, const LonLat& at) {
  MissionItem item;
  item.command = command;
  item.frame = frame;
  item.x = e7(at.lat_deg);
  item.y = e7(at.lon_deg);
  return item;
}

void add_area(std::vector<MissionItem>& items, int command, const GeoPolygon& area) {
  for (const auto& corner : area) {
    items.push_back(place(command, k_global, corner));
    items.back().p1 = static_cast<double>(area.size());
  }
}

/// Autopilots keep a height as a float of centimetres, a frame in its other name, and parameters they do not
/// use as nothing: what matters is the kind of item and its place.
bool alike(const MissionItem& a, const MissionItem& b) {
  return a.command == b.command && std::abs(a.x - b.x) <= 1 && std::abs(a.y - b.y) <= 1 &&
         std::abs(a.z - b.z) < 0.02;
}

/// Item 0 of ArduPilot's missions is home, which it sets itself.
std::string difference(const std::vector<MissionItem>& wanted, const std::vector<MissionItem>& kept,
                       std::size_t first) {
  if (wanted.size() != kept.size())
    return "the autopilot stored " + std::to_string(kept.size()) + " of " + std::to_string(wanted.size()) +
           " items";
  for (std::size_t i = first; i < wanted.size(); ++i) {
    if (!alike(wanted[i], kept[i])) return "the autopilot stored a different item " + std::to_string(i);
  }
  return {};
}

/// MAV_MISSION_RESULT of the common set.
std::string result_words(std::int64_t type) {
  switch (type) {
    case 1:
      return "the autopilot refuses it without a reason";
    case 2:
      return "the autopilot does not know the frame of an item";
    case 3:
      return "the autopilot does not support this list";
    case 4:
      return "the autopilot has no space for so many items";
    case 13:
      return "the autopilot got the items out of order";
    case 14:
      return "the autopilot accepts no lists from this ground station";
    case 15:
      return "the autopilot canceled the transfer";
    default:
      return "the autopilot refuses an item as invalid (MISSION_ACK type " + std::to_string(type) + ")";
  }
}

}  // namespace

std::uint64_t Session::upload_route(const std::vector<RoutePoint>& route) {
  std::vector<MissionItem> items;
  const auto& home = telemetry_.newest().home;
  if (dialect_of(autopilot_).home_is_item_0)
    items.push_back(place(k_waypoint, k_global, home ? LonLat{home->lon_deg, home->lat_deg} : LonLat{}));
  for (const auto& point : route) {
    items.push_back(place(k_waypoint, k_above_home, point.at));
    items.back().p1 = point.dwell_s;
    items.back().p4 = point.heading_deg.value_or(std::nan(""));
    items.back().z = point.height_m;
  }
  return upload(ItemList::mission, std::move(items), true);
}

std::uint64_t Session::upload_fence(const DroneFence& fence) {
  std::vector<MissionItem> items;
  add_area(items, k_fence_inside, fence.inside);
  for (const auto& area : fence.outside) add_area(items, k_fence_outside, area);
  return upload(ItemList::fence, std::move(items), true);
}

std::uint64_t Session::upload(ItemList list, std::vector<MissionItem> items, bool check) {
  const std::uint64_t number = ++number_;
  if (!last_seen_s_) {
    deaf(number, "upload");
    return number;
  }
  if (items.size() > k_max_items) {
    report(number, "upload", CommandState::refused, "more than 1000 items");
    return number;
  }
  if (const auto before = waiting_.extract(list)) replaced(before.mapped().number, list);
  report(number, "upload", CommandState::sent, list_word(list));
  Transfer up{number, true, list, std::move(items), 0, 0, 0, 0, check, {}};
  up.count = up.items.size();
  up.asked.resize(up.count);
  waiting_.emplace(list, std::move(up));
  next_transfer();
  return number;
}

void Session::replaced(std::uint64_t number, ItemList list) {
  report(number, "upload", CommandState::unconfirmed, "followed by another upload of the " + list_word(list));
}

/// Begins the upload that has waited longest, once nothing else is transferred.
void Session::next_transfer() {
  if (transfer_ || waiting_.empty()) return;
  const auto oldest =
      std::ranges::min_element(waiting_, {}, [](const auto& one) { return one.second.number; });
  if (const auto before = kept_.extract(oldest->first)) replaced(before.mapped(), oldest->first);
  transfer_ = std::move(waiting_.extract(oldest).mapped());
  transfer_->last_s = now_s_ - k_wait_s;
  drive_transfer();
}

std::uint64_t Session::download(ItemList list) {
  const std::uint64_t number = ++number_;
  if (transfer_) {
    report(number, "download", CommandState::refused, "another transfer is running");
    return number;
  }
  report(number, "download", CommandState::sent, list_word(list));
  transfer_ = Transfer{number, false, list, {}, 0, 0, now_s_ - k_wait_s, 0, false, {}};
  drive_transfer();
  return number;
}

/// What was read back is no longer known to be there.
void Session::lists_lost(const std::string& why) {
  for (const auto& [list, number] : std::exchange(kept_, {}))
    report(number, "upload", CommandState::unconfirmed, why);
}

void Session::end_transfer(CommandState state, std::string text) {
  const Transfer done = *std::exchange(transfer_, std::nullopt);
  if (state == CommandState::accepted && done.up && done.check) {
    Transfer back{done.number, false, done.list, {}, 0, 0, now_s_ - k_wait_s, 0, true, done.items};
    transfer_ = std::move(back);
    return drive_transfer();
  }
  if (state == CommandState::accepted && done.check) {
    const bool home_first = done.list == ItemList::mission && dialect_of(autopilot_).home_is_item_0;
    if (auto differs = difference(done.wanted, items_, home_first ? 1 : 0); !differs.empty()) {
      state = CommandState::unconfirmed;  // and sent again: nothing of it was refused
      text = std::move(differs);
    } else {
      text += ", read back";
      kept_[done.list] = done.number;
    }
  }
  report(done.number, done.up || done.check ? "upload" : "download", state, std::move(text));
  next_transfer();
}

void Session::send_item(std::size_t index) {
  const auto& item = transfer_->items[index];
  Message m = addressed("MISSION_ITEM_INT");
  m.set("seq", static_cast<std::int64_t>(index)).set("command", item.command).set("frame", item.frame);
  m.set_real("param1", item.p1)
      .set_real("param2", item.p2)
      .set_real("param3", item.p3)
      .set_real("param4", item.p4);
  m.set("x", item.x).set("y", item.y).set_real("z", item.z);
  m.set("autocontinue", 1).set("mission_type", static_cast<std::int64_t>(transfer_->list));
  send(m);
}

/// Repeats what was not answered within 1.5 s, five times.
void Session::drive_transfer() {
  if (!transfer_ || now_s_ - transfer_->last_s < k_wait_s) return;
  auto& t = *transfer_;
  if (t.tries++ >= k_transfer_tries)
    return end_transfer(CommandState::unconfirmed, "the autopilot does not answer");
  t.last_s = now_s_;
  const auto list = static_cast<std::int64_t>(t.list);
  if (t.up) {
    send(addressed("MISSION_COUNT")
             .set("count", static_cast<std::int64_t>(t.count))
             .set("mission_type", list));
  } else if (t.count == 0) {
    send(addressed("MISSION_REQUEST_LIST").set("mission_type", list));
  } else {
    send(addressed("MISSION_REQUEST_INT")
             .set("seq", static_cast<std::int64_t>(t.next))
             .set("mission_type", list));
  }
}

/// What the autopilot tells another ground station of a list: taken, it is no longer the one from here.
void Session::on_foreign_transfer(const Message& m) {
  if (!m.is("MISSION_ACK") || m.integer("type") != 0) return;
  const auto replaced = m.integer("mission_type");
  for (auto kept = kept_.begin(); kept != kept_.end();) {
    const bool all = replaced == k_all_lists;
    if (!all && replaced != static_cast<std::int64_t>(kept->first)) {
      ++kept;
      continue;
    }
    report(kept->second, "upload", CommandState::unconfirmed,
           "another ground station (system " + std::to_string(m.integer("target_system")) +
               ") has replaced the " + list_word(kept->first) + " in the autopilot since");
    kept = kept_.erase(kept);
  }
}

void Session::on_transfer(const Message& m) {
  const bool is_list = m.is("MISSION_ACK") || m.is("MISSION_REQUEST_INT") || m.is("MISSION_REQUEST") ||
                       m.is("MISSION_COUNT") || m.is("MISSION_ITEM_INT");
  const auto target = is_list ? m.integer("target_system") : 0;
  if (target != 0 && target != options_.self.system) return on_foreign_transfer(m);
  if (!transfer_ || (is_list && m.integer("mission_type") != static_cast<std::int64_t>(transfer_->list)))
    return;
  auto& t = *transfer_;
  const auto answered = [&] {
    t.tries = 0;
    t.last_s = now_s_;
  };
  if (t.up && (m.is("MISSION_REQUEST_INT") || m.is("MISSION_REQUEST"))) {
    const auto seq = m.integer("seq");
    if (seq >= 0 && static_cast<std::size_t>(seq) < t.items.size()) {
      // Whoever asks for one again and again gets nothing: it must end, for nothing else can be sent
      // meanwhile.
      if (++t.asked[static_cast<std::size_t>(seq)] > k_same_item)
        return end_transfer(CommandState::unconfirmed,
                            "the autopilot asks for item " + std::to_string(seq) +
                                " again and again: does the link lose long frames?");
      answered();
      send_item(static_cast<std::size_t>(seq));
    }
  } else if (t.up && m.is("MISSION_ACK")) {
    const auto type = m.integer("type");
    end_transfer(type == 0 ? CommandState::accepted : CommandState::refused,
                 type == 0 ? std::to_string(t.count) + " items" : result_words(type));
  } else if (!t.up && m.is("MISSION_COUNT") && t.count == 0) {
    answered();
    t.count = static_cast<std::size_t>(m.integer("count"));
    if (t.count > k_max_items) return end_transfer(CommandState::refused, "more than 1000 items");
    if (t.count == 0) {
      items_.clear();
      return end_transfer(CommandState::accepted, "0 items");
    }
    send(addressed("MISSION_REQUEST_INT")
             .set("seq", 0)
             .set("mission_type", static_cast<std::int64_t>(t.list)));
  } else if (!t.up && m.is("MISSION_ITEM_INT") && m.integer("seq") == static_cast<std::int64_t>(t.next)) {
    answered();
    t.items.push_back({static_cast<int>(m.integer("command")), static_cast<int>(m.integer("frame")),
                       m.real("param1"), m.real("param2"), m.real("param3"), m.real("param4"),
                       static_cast<std::int32_t>(m.integer("x")), static_cast<std::int32_t>(m.integer("y")),
                       m.real("z")});
    if (++t.next < t.count) {
      send(addressed("MISSION_REQUEST_INT")
               .set("seq", static_cast<std::int64_t>(t.next))
               .set("mission_type", static_cast<std::int64_t>(t.list)));
      return;
    }
    send(addressed("MISSION_ACK").set("mission_type", static_cast<std::int64_t>(t.list)));
    items_ = t.items;
    end_transfer(CommandState::accepted, std::to_string(t.count) + " items");
  }
}

}  // namespace anchord::drone
