#pragma once

#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "drivers/device/pipeline.hpp"

namespace anchord::device::test {

/// Keeps everything a pipeline says; rows as text with every bit of their numbers.
struct Collect final : PipelineSink {
  void send(std::uint16_t slot, std::string_view bytes) override { sent[slot] += bytes; }
  void fix(std::uint16_t slot, const Fix& f) override {
    fixes.push_back(f);
    char text[400];
    std::snprintf(text, sizeof text, "fix %u %s %lld %lld %llu %a %a %a %d %a %a\n", unsigned{slot},
                  to_string(f.mission).c_str(), static_cast<long long>(f.time.ns),
                  static_cast<long long>(f.received ? f.received->ns : 0),
                  static_cast<unsigned long long>(f.seq.value_or(0)), f.position.lat_deg, f.position.lon_deg,
                  f.position.height_m, static_cast<int>(f.fix), f.correction_age_s.value_or(-1),
                  f.covariance_m2 ? f.covariance_m2->sum() : -1.0);
    rows += text;
  }
  void range(std::uint16_t slot, const Range& r) override {
    ranges.push_back(r);
    char text[200];
    std::snprintf(text, sizeof text, "range %u %lld %u %u %a\n", unsigned{slot},
                  static_cast<long long>(r.time.ns), r.tag.value, r.anchor.value, r.distance_m);
    rows += text;
  }
  void rover(std::uint16_t, const RoverStatus& status) override { rovers.push_back(status); }
  void identified(std::uint16_t slot, const Identity& who) override { identities[slot] = who; }
  void clock(std::uint16_t slot, const ClockReading& reading) override { clocks[slot] = reading; }
  void heard(std::uint16_t) override { ++heard_count; }
  void dropped(std::uint16_t, std::string_view reason, std::uint64_t n) override {
    drops[std::string(reason)] += n;
  }
  void notice(std::uint16_t slot, std::string_view text) override { notices[slot] = std::string(text); }
  void unused(std::uint16_t slot, std::string_view why) override { unused_why[slot] = std::string(why); }
  void answer(std::uint16_t, std::uint64_t id, const Result<std::string>& json) override {
    answers[id] = json ? json.value() : "error: " + json.error().message;
  }
  void hang_up(std::uint16_t, std::string_view why, std::int64_t wait_ns) override {
    hung_up = std::string(why);
    hang_up_wait_ns = wait_ns;
  }

  std::string hung_up;
  std::int64_t hang_up_wait_ns{0};
  std::map<std::uint16_t, std::string> sent;
  std::vector<Fix> fixes;
  std::vector<Range> ranges;
  std::vector<RoverStatus> rovers;
  std::map<std::uint16_t, Identity> identities;
  std::map<std::uint16_t, ClockReading> clocks;
  std::map<std::string, std::uint64_t> drops;
  std::map<std::uint16_t, std::string> notices;
  std::map<std::uint16_t, std::string> unused_why;
  std::map<std::uint64_t, std::string> answers;
  std::string rows;
  int heard_count{0};
};

}  // namespace anchord::device::test
