// A caster's answer, whole and in pieces: the same corrections reach the rover, and nothing grows.
#include <cstdint>
#include <string>

#include "drivers/ntrip/client.hpp"
#include "drivers/time/time_base.hpp"
#include "tests/fuzz/check.hpp"

namespace {

using namespace anchord;

struct Output final : device::DriverOutput {
  void send(std::string_view) override {}
  void emit(Fix) override {}
  void emit(Range) override {}
  void rover(const device::RoverStatus&) override {}
  void identified(const device::Identity&) override {}
  void heard() override {}
  void dropped(std::string_view, std::uint64_t) override {}
  void answer(std::uint64_t, Result<std::string>) override {}
  void corrections(std::string_view bytes) override { passed += bytes; }
  void hang_up(std::string_view why, std::int64_t) override {
    fuzz::require(why.size() < 600, "reasons are short");
    hung_up = true;
  }
  std::optional<device::RoverStatus> rover_position() const override { return std::nullopt; }
  timing::TimeBase& time() override { return base; }
  std::uint16_t slot() const override { return 1; }
  std::string passed;
  bool hung_up{false};
  timing::TimeBase base;
};

std::string passed(std::string_view bytes, std::size_t piece, bool& hung_up) {
  Output out;
  ntrip::ClientOptions options;
  options.mount = "M";
  ntrip::Client client(options, out);
  client.opened({});
  for (std::size_t at = 0; at < bytes.size(); at += piece) client.bytes(bytes.substr(at, piece), {});
  hung_up = out.hung_up;
  client.closed({});
  return out.passed;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  bool whole_up = false, piece_up = false;
  const std::string whole = passed(bytes, size + 1, whole_up), pieces = passed(bytes, 2, piece_up);
  fuzz::require(whole.size() <= size, "nothing is invented");
  if (size < 16'000)
    fuzz::require(whole == pieces && whole_up == piece_up, "cutting the stream changes nothing");
  return 0;
}
