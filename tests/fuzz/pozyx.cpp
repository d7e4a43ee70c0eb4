// What a tag, or anything else on its port, may say: every answer that belongs to its question by form, cut,
// garbled, late. No range that leaves the driver is one of the failure values.
#include <algorithm>
#include <cstdint>
#include <string>

#include "drivers/pozyx/protocol.hpp"
#include "drivers/pozyx/unit.hpp"
#include "drivers/time/time_base.hpp"
#include "tests/fuzz/check.hpp"

namespace {

using namespace anchord;

struct Output final : device::DriverOutput {
  void send(std::string_view bytes) override {
    fuzz::require(bytes.size() <= 4096, "questions are short");
    asked.append(bytes);
  }
  void emit(Fix) override { fuzz::require(false, "a tag has no positions"); }
  void emit(Range range) override {
    fuzz::require(range.distance_m > 0 && range.distance_m < 1000, "no failure value is a range");
    fuzz::require(range.rss_dbm && *range.rss_dbm >= -120 && *range.rss_dbm <= -40, "levels are possible");
    fuzz::require(!range.cir || range.cir->re_im.size() <= 2 * 1016, "impulse responses are bounded");
  }
  void rover(const device::RoverStatus&) override {}
  void identified(const device::Identity&) override {}
  void heard() override {}
  void dropped(std::string_view reason, std::uint64_t) override {
    fuzz::require(!reason.empty() && reason.size() < 40, "reasons are words");
  }
  void answer(std::uint64_t, Result<std::string>) override {}
  void corrections(std::string_view) override {}
  void hang_up(std::string_view, std::int64_t) override { hung_up = true; }
  std::optional<device::RoverStatus> rover_position() const override { return std::nullopt; }
  timing::TimeBase& time() override { return base; }
  std::uint16_t slot() const override { return 1; }

  std::string asked;
  bool hung_up{false};
  timing::TimeBase base;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Output out;
  pozyx::UnitOptions options;
  options.anchor_anchor_s = 0.1;
  pozyx::Unit unit(options, out);
  std::int64_t now_ns = 1'000'000'000;
  const auto at = [&] { return device::Arrival{UtcTime{1'700'000'000'000'000'000 + now_ns}, now_ns}; };
  unit.opened(at());
  pozyx::Lines questions;
  std::size_t i = 0;
  const auto next = [&]() -> std::uint8_t { return i < size ? data[i++] : 0; };
  while (i < size && !out.hung_up) {
    if (const auto due = unit.deadline_ns()) {
      fuzz::require(*due > now_ns - 1'000'000'000, "deadlines are not long over");
    }
    const std::uint8_t what = next();
    questions.feed(std::exchange(out.asked, {}));
    const auto line = questions.next();
    const auto command =
        line ? pozyx::parse_command(*line) : Result<pozyx::Command>(make_error(Errc::bad_frame, ""));
    if (what >= 32 && command && command.value().kind != pozyx::Command::Kind::write) {
      pozyx::Bytes reply(std::min<std::size_t>(command.value().count, 256));
      for (auto& byte : reply) byte = next();
      if (command.value().kind == pozyx::Command::Kind::function && !reply.empty()) reply[0] = 1;
      if (command.value().address == 0 && !reply.empty()) reply[0] = 0x43;
      if (command.value().address == 5 && !reply.empty()) reply[0] |= 0x10;
      std::string text = pozyx::reply_line(reply);
      if (what < 40) text.resize(text.size() / 2);
      now_ns += 1'000'000;
      unit.bytes(text, at());
    } else if (what % 4 == 0) {
      std::string noise;
      for (std::size_t n = next() % 40u; n > 0; --n) noise += static_cast<char>(next());
      now_ns += 1'000'000;
      unit.bytes(noise, at());
    } else if (const auto due = unit.deadline_ns()) {
      now_ns = std::max(now_ns + 1, *due);
      unit.tick(at());
    } else {
      break;
    }
  }
  unit.closed(at());
  return 0;
}
