// Mission and fence lists, as a vehicle takes them in and hands them out.
#include "drivers/sim/autopilot.hpp"

namespace anchord::sim {

using mavlink::Message;

void AutopilotSim::lists(const Message& m, mavlink::Address from) {
  const char* request = options_.old_requests ? "MISSION_REQUEST" : "MISSION_REQUEST_INT";
  const auto list_of = [&]() -> std::vector<Message>& {
    return m.integer("mission_type") == 1 ? fence_ : mission_;
  };
  const auto to = [&](Message out) {
    out.set("target_system", from.system).set("target_component", from.component);
    out.set("mission_type", m.integer("mission_type"));
    send(out);
  };
  if (m.integer("mission_type") == 1 && !options_.keeps_fences) {
    to(Message("MISSION_ACK").set("type", 3));  // unsupported
  } else if (m.is("MISSION_COUNT")) {
    list_of().clear();
    wanted_ = static_cast<std::size_t>(m.integer("count"));
    uploading_ = static_cast<int>(m.integer("mission_type"));
    to(wanted_ == 0 ? Message("MISSION_ACK") : Message(request).set("seq", 0));
  } else if (m.is("MISSION_ITEM_INT") && uploading_ == m.integer("mission_type")) {
    auto& list = list_of();
    if (m.integer("seq") != static_cast<std::int64_t>(list.size())) return;
    list.push_back(m);
    const bool last = list.size() == wanted_;
    to(last ? Message("MISSION_ACK") : Message(request).set("seq", static_cast<std::int64_t>(list.size())));
    if (last) uploading_ = -1;
  } else if (m.is("MISSION_REQUEST_LIST")) {
    to(Message("MISSION_COUNT").set("count", static_cast<std::int64_t>(list_of().size())));
  } else if (m.is("MISSION_REQUEST_INT")) {
    const auto seq = static_cast<std::size_t>(m.integer("seq"));
    if (seq < list_of().size()) to(list_of()[seq]);
  }
}

}  // namespace anchord::sim
