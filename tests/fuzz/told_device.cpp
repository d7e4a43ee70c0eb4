// Bytes of a device of one kind (ANCHORD_FUZZ_KIND), through its driver to what is told of it: status, wire,
// log.
#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "api/devices/device_json.hpp"
#include "core/ports/devices.hpp"
#include "drivers/device/pipeline.hpp"
#include "drivers/device/settings.hpp"
#include "drivers/pozyx/protocol.hpp"
#include "tests/fuzz/told.hpp"

namespace {

using namespace anchord;
using record::EventKind;

constexpr std::string_view k_kind = ANCHORD_FUZZ_KIND;

/// As the server's device manager makes its report of it.
struct Status final : device::PipelineSink {
  void send(std::uint16_t, std::string_view bytes) override { asked += bytes; }
  void fix(std::uint16_t, const Fix&) override {}
  void range(std::uint16_t, const Range&) override {}
  void rover(std::uint16_t, const device::RoverStatus& s) override {
    report.rover = DeviceReport::Rover{s.time, s.fix, s.satellites, s.age_s, s.sigma_h_m, s.sigma_v_m};
  }
  void identified(std::uint16_t, const device::Identity& who) override {
    report.model = who.model, report.firmware = who.firmware, report.serial = who.serial;
    report.network_id = who.network_id;
    for (const auto* word : {&report.model, &report.firmware, &report.serial}) fuzz::told(*word);
  }
  void base(std::uint16_t, const BaseStation& station) override { report.base = station; }
  void heard(std::uint16_t) override {}
  void dropped(std::uint16_t, std::string_view reason, std::uint64_t n) override {
    fuzz::told(reason);
    report.dropped[std::string(reason)] += n;
  }
  void answer(std::uint16_t, std::uint64_t, const Result<std::string>& json) override {
    fuzz::told(json ? json.value() : json.error().message);
  }
  void hang_up(std::uint16_t, std::string_view why, std::int64_t) override {
    fuzz::told(why);
    report.reason = why;
  }
  DeviceReport report;
  std::string asked;
};

/// A tag is only heard where it answers what was asked: replies that fit by form, of bytes of the input.
std::string reply(pozyx::Lines& questions, std::string asked, std::string_view& rest) {
  questions.feed(std::move(asked));
  const auto line = questions.next();
  if (!line || rest.empty()) return {};
  const auto command = pozyx::parse_command(*line);
  if (!command) return {};
  pozyx::Bytes bytes(std::min<std::size_t>(command.value().count, 256));
  for (auto& byte : bytes) {
    byte = rest.empty() ? std::uint8_t{0} : static_cast<std::uint8_t>(rest.front());
    if (!rest.empty()) rest.remove_prefix(1);
  }
  if (command.value().address == 0 && !bytes.empty()) bytes[0] = 0x43;  // who-am-I of a Pozyx
  return pozyx::reply_line(bytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  Status status;
  device::Pipeline pipeline(status);
  std::int64_t now_ns = 1'000'000'000;
  const auto take = [&](EventKind kind, std::string_view payload = {}) {
    const link::Arrival at{UtcTime{1'718'269'200'000'000'000 + now_ns}, now_ns};
    (void)pipeline.take({kind, 1, at, payload});
    now_ns += 20'000'000;
  };
  device::Settings settings{"id", std::string(k_kind), "name", "tcp://192.0.2.1:2101", "{}"};
  if (k_kind == "ntrip") settings.options_json = R"({"mount":"BASE","version":1})";
  take(EventKind::added, device::to_json(settings));
  take(EventKind::opened);
  pozyx::Lines questions;
  while (!rest.empty()) {
    // Pieces of 1 to 63 bytes, so that characters are cut between reads.
    const std::size_t piece = 1 + (static_cast<unsigned char>(rest.front()) & 63u);
    rest.remove_prefix(1);
    auto answer = k_kind == "pozyx" && piece > 8 ? reply(questions, std::exchange(status.asked, {}), rest)
                                                 : std::string();
    if (!answer.empty()) {
      take(EventKind::bytes, answer);
    } else {
      take(EventKind::bytes, rest.substr(0, piece));
      rest.remove_prefix(std::min(piece, rest.size()));
    }
    if (const auto due = pipeline.deadline_ns(1); due && *due <= now_ns) take(EventKind::tick);
  }
  take(EventKind::command, device::to_json(device::Command{7, "say " + std::string(settings.kind), "{}"}));
  take(EventKind::closed);
  status.report.config.kind = settings.kind;
  fuzz::told_json(api::device_json(status.report));
  fuzz::told_json(api::device_row_json(status.report));
  return 0;
}
