// Messages of an aircraft with any bytes in their fields, through the session to what is told of it.
#include <cstdint>
#include <span>
#include <string>

#include "drivers/drone/session.hpp"
#include "tests/fuzz/told.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  drone::Session session;
  mavlink::Packer aircraft({1, 1});
  double now_s = 1;
  const auto feed = [&](std::span<const std::uint8_t> bytes) {
    session.feed(now_s, 1'777'888'800'000'000, bytes);
    session.tick(now_s, 1'777'888'800'000'000);
    now_s += 0.1;
  };
  feed(
      aircraft.pack(mavlink::Message("HEARTBEAT").set("type", 2).set("autopilot", 3).set("base_mode", 0x81)));
  (void)session.hold();
  (void)session.take_off(5);
  std::span rest(data, size);
  while (rest.size() > 2) {
    // Which message, how many bytes of it; what is left of the input at the end goes in as it is.
    const auto all = mavlink::messages();
    const bool text = rest[0] < 128;
    const auto& info = text ? *mavlink::find_message("STATUSTEXT") : all[rest[0] % all.size()];
    const std::size_t n = std::min<std::size_t>(rest[1], rest.size() - 2);
    feed(aircraft.pack(mavlink::Message(info, rest.subspan(2, n))));
    rest = rest.subspan(2 + n);
  }
  feed(rest);
  for (int i = 0; i < 80; ++i) feed({});  // what waits for an answer is given up, with the newest text in it
  const auto status = session.status();
  fuzz::told(status.text);
  fuzz::told(status.mode);
  nlohmann::ordered_json wire{{"text", status.text}, {"mode", status.mode}, {"reports", {}}};
  for (const auto& report : session.take_reports()) {
    fuzz::told(report.text);
    wire["reports"].push_back({{"what", report.what}, {"text", report.text}});
  }
  fuzz::told_json(wire);
  return 0;
}
