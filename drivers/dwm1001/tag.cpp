#include "drivers/dwm1001/tag.hpp"

#include <nlohmann/json.hpp>
#include <utility>

#include "core/base/enum_table.hpp"
#include "drivers/time/time_base.hpp"

namespace anchord::dwm1001 {
namespace {

constexpr std::int64_t k_s = 1'000'000'000;
constexpr std::int64_t k_answer_ns = 2 * k_s;  ///< of the shell
constexpr std::int64_t k_restart_ns = 3 * k_s / 2;
constexpr std::int64_t k_poll_ns = k_s / 10;   ///< the fastest rate of the firmware is 10 Hz
constexpr std::int64_t k_binary_ns = k_s / 2;  ///< of an answer in binary
constexpr std::size_t k_most_line = 2000, k_most_answer = 600;
constexpr int k_tries = 3;
// As rows that come over REST.
constexpr double k_min_distance_m = 0.05, k_max_distance_m = 150;

}  // namespace

void Tag::opened(const device::Arrival& now) {
  held_.clear();
  newest_.clear();
  skip_ = asked_ = restarted_ = false;
  tries_ = 0;
  id_.reset();
  if (options_.mode == Mode::tlv) {
    state_ = State::ranging;
    identify(*options_.tag);
    deadline_ns_ = now.steady_ns;
    return;
  }
  state_ = State::waking;
  deadline_ns_ = now.steady_ns + k_answer_ns;
  out_.send("\r\r");  // Enter twice within a second opens the shell
}

void Tag::identify(NetworkId id) {
  id_ = id;
  device::Identity identity;
  identity.model = "DWM1001";
  identity.serial = to_string(id);
  identity.network_id = id;
  out_.identified(identity);
}

void Tag::bytes(std::string_view bytes, const device::Arrival& at) {
  if (state_ == State::closed) return;
  if (options_.mode == Mode::tlv) {
    held_ += bytes.substr(0, k_most_answer - std::min(held_.size(), k_most_answer));
    return location(at);
  }
  for (const char c : bytes) {
    if (c == '\n' || c == '\r') {
      const std::string text = std::exchange(held_, {});
      if (std::exchange(skip_, false))
        out_.dropped("line_too_long");
      else if (!text.empty())
        line(text, at);
    } else if (held_.size() >= k_most_line) {
      skip_ = true;
    } else {
      held_ += c;
      // The prompt has no line end.
      if (held_.ends_with("dwm> ")) prompt(at);
    }
    if (state_ == State::closed) return;
  }
}

void Tag::prompt(const device::Arrival& at) {
  if (state_ == State::waking) {
    held_.clear();
    out_.heard();
    const bool again = std::exchange(restarted_, true);
    state_ = again ? State::asking : State::restarting;
    deadline_ns_ = at.steady_ns + (again ? k_answer_ns : k_restart_ns);
    return out_.send(again ? "si\r" : "reset\r");
  }
  if (state_ == State::asking && id_) begin_les();
}

void Tag::begin_les() {
  state_ = State::ranging;
  deadline_ns_.reset();  // what stays silent is opened anew by the supervisor
  out_.send("les\r");
}

void Tag::line(std::string_view text, const device::Arrival& at) {
  if (state_ == State::asking) {
    if (const auto id = node_id_in(text); id && !id_) {
      identify(options_.tag.value_or(NetworkId{static_cast<std::uint32_t>(*id & 0xffff)}));
      out_.heard();
    }
  }
  const auto found = parse_les(text);
  if (state_ != State::ranging) return;
  if (!found) return out_.dropped("bad_line");
  if (!found.value()) return;
  out_.heard();
  emit(*found.value(), at);
}

void Tag::emit(const std::vector<Distance>& distances, const device::Arrival& at) {
  for (const auto& one : distances) {
    if (one.distance_m <= 0) {
      out_.dropped("zero_distance");
      continue;
    }
    if (one.distance_m < k_min_distance_m || one.distance_m > k_max_distance_m || one.anchor == id_->value) {
      out_.dropped("out_of_reach");
      continue;
    }
    Range range;
    range.time = out_.time().utc_of(at.steady_ns).time;
    range.received = range.time;
    range.tag = *id_;
    range.anchor = {one.anchor};
    range.seq = seq_++;
    range.distance_m = one.distance_m;
    out_.emit(std::move(range));
  }
}

void Tag::location(const device::Arrival& at) {
  const auto parsed = parse_location(held_);
  if (!parsed) {
    held_.clear();
    return out_.dropped("bad_reply");
  }
  if (!parsed.value()) return;
  const Location& found = *parsed.value();
  const std::string answer = held_.substr(0, found.bytes);
  held_.clear();
  asked_ = false;
  deadline_ns_ = at.steady_ns + k_poll_ns;
  out_.heard();
  if (found.error != 0) return out_.dropped("refused");
  if (found.is_anchor) return out_.hang_up("this DWM1001 is set up as an anchor: make it a tag", 60 * k_s);
  // Asked faster than it measures, it answers the same again: distances to the millimetre do not repeat.
  if (answer == newest_) {
    if (!found.distances.empty()) out_.dropped("repeated");
    return;
  }
  newest_ = answer;
  emit(found.distances, at);
}

void Tag::tick(const device::Arrival& now) {
  if (state_ == State::closed || !deadline_ns_ || now.steady_ns < *deadline_ns_) return;
  if (options_.mode == Mode::tlv) {
    if (asked_) {
      out_.dropped("no_reply");
      held_.clear();
    }
    asked_ = true;
    deadline_ns_ = now.steady_ns + k_binary_ns;
    return out_.send(loc_get_request());
  }
  deadline_ns_ = now.steady_ns + k_answer_ns;
  switch (state_) {
    case State::closed:
      return;
    case State::waking:
      if (++tries_ > k_tries)
        return out_.hang_up("no DWM1001 shell answers: is this the right port, at 115200 baud?", 5 * k_s);
      return out_.send("\r\r");
    case State::restarting:
      state_ = State::waking;
      tries_ = 0;
      held_.clear();
      return out_.send("\r\r");
    case State::asking:
      if (!id_ && options_.tag) identify(*options_.tag);
      if (!id_)
        return out_.hang_up("its shell does not show the id (command si): set the option tag", 60 * k_s);
      return begin_les();
    case State::ranging:
      return;
  }
}

void Tag::closed(const device::Arrival&) {
  state_ = State::closed;
  deadline_ns_.reset();
}

void Tag::command(const device::Command& command, const device::Arrival&) {
  out_.answer(command.id, make_error(Errc::unsupported, "a DWM1001 does not support commands"));
}

Result<std::unique_ptr<device::Driver>> make_tag(std::string_view options_json,
                                                 device::DriverOutput& output) {
  using Json = nlohmann::json;
  const auto bad = [](std::string_view option, const std::string& why) {
    return make_error(Errc::invalid_argument, std::string(option) + ": " + why);
  };
  const auto options = Json::parse(options_json.begin(), options_json.end(), nullptr, false);
  TagOptions out;
  for (const auto& [key, value] : options.items()) {
    const std::string text = value.is_string() ? value.get<std::string>() : "";
    if (key == "mode") {
      const auto mode = k_mode_words.find(text);
      if (!mode) return bad(key, "must be one of " + list_of(k_mode_words.words()));
      out.mode = *mode;
    } else if (key == "tag") {
      const auto id = parse_network_id(text);
      if (!id) return bad(key, "must be an id like 0x022e");
      out.tag = id.value();
    } else {
      return bad(key, "no such option: a dwm1001 device has mode, tag");
    }
  }
  if (out.mode == Mode::tlv && !out.tag)
    return bad("tag", "is needed in binary mode: give an id like 0x022e");
  return std::unique_ptr<device::Driver>(std::make_unique<Tag>(out, output));
}

}  // namespace anchord::dwm1001
