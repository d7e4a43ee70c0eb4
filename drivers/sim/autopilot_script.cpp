#include "drivers/sim/autopilot_script.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <sstream>

namespace anchord::sim {
namespace {

using Failsafe = AutopilotSim::Failsafe;

Error bad(std::string_view words, const char* why) {
  return make_error(Errc::invalid_argument, "\"" + std::string(words) + "\": " + why);
}

std::optional<Failsafe> failsafe_of(const std::string& word) {
  if (word == "radio") return Failsafe::radio;
  if (word == "battery") return Failsafe::battery;
  if (word == "ekf") return Failsafe::ekf;
  if (word == "station") return Failsafe::station;
  return std::nullopt;
}

/// The options that are one number.
double* number(AutopilotOptions& o, const std::string& word) {
  if (word == "drift") return &o.baro_drift_mps;
  if (word == "sag") return &o.sag_v;
  if (word == "latency") return &o.latency_s;
  if (word == "acks_late") return &o.ack_delay_s;
  if (word == "acks_lost") return &o.ack_loss;
  if (word == "mode_lag") return &o.mode_lag_s;
  return nullptr;
}

}  // namespace

Result<void> happen(AutopilotSim& autopilot, std::string_view words) {
  std::istringstream in{std::string(words)};
  std::string what, word;
  in >> what;
  auto& o = autopilot.options();
  double value = 0;
  if (what == "pilot") {
    in >> word;
    const auto mode = drone::mode_of(o.dialect, word);
    if (!mode) return bad(words, "the autopilot has no such mode");
    autopilot.pilot_takes_over(*mode);
  } else if (what == "pilot_lands") {
    autopilot.pilot_lands();
  } else if (what == "failsafe") {
    in >> word;
    const auto failsafe = failsafe_of(word);
    if (!failsafe) return bad(words, "radio, battery, ekf or station");
    autopilot.fail(*failsafe);
  } else if (what == "refuse") {
    std::getline(in >> std::ws, word);
    autopilot.refuse_arming(word);
  } else if (what == "silent" && in >> value) {
    autopilot.be_silent(value);
  } else if (what == "gnss" && in >> o.gnss_offset_m.x() >> o.gnss_offset_m.y() >> o.gnss_offset_m.z()) {
  } else if (what == "loss" && in >> value) {
    o.loss = o.loss_in = value;
  } else if (what == "old_streams" && in >> value) {
    o.old_streams = value > 0;
  } else if (what == "parameter" && in >> word >> value) {
    autopilot.set_parameter(word, value);
  } else if (what == "battery" && in >> value) {
    autopilot.vehicle().set_battery(value);
  } else if (what == "battery_warning" && in >> value) {
    autopilot.set_battery_warning(static_cast<int>(value));
  } else if (what == "restart") {
    if (!autopilot.restart()) return bad(words, "it is in the air");
  } else if (auto* option = number(o, what); option != nullptr && in >> value) {
    *option = value;
  } else {
    return bad(words, "unknown, or its value is missing; see drivers/sim/autopilot.md");
  }
  return boost::outcome_v2::success();
}

Result<AutopilotScript> AutopilotScript::read(std::istream& in) {
  AutopilotScript out;
  std::string line;
  for (int n = 1; std::getline(in, line); ++n) {
    line = line.substr(0, line.find('#'));
    std::istringstream parts(line);
    Line one;
    if (!(parts >> std::ws) || parts.eof()) continue;
    if (!(parts >> one.at_s))
      return make_error(Errc::invalid_argument, "line " + std::to_string(n) + " does not begin with seconds");
    std::getline(parts >> std::ws, one.words);
    while (!one.words.empty() && one.words.back() <= ' ') one.words.pop_back();
    out.lines_.push_back(std::move(one));
  }
  std::stable_sort(out.lines_.begin(), out.lines_.end(),
                   [](const Line& a, const Line& b) { return a.at_s < b.at_s; });
  return out;
}

std::vector<std::string> AutopilotScript::due(AutopilotSim& autopilot) {
  std::vector<std::string> out;
  for (; next_ < lines_.size() && lines_[next_].at_s <= autopilot.now_s(); ++next_) {
    const auto done = happen(autopilot, lines_[next_].words);
    out.push_back(done ? lines_[next_].words : done.error().message);
  }
  return out;
}

}  // namespace anchord::sim
