#include "drivers/drone/peer_gate.hpp"

#include <algorithm>

#include "drivers/drone/vehicle_kind.hpp"

namespace anchord::drone {
namespace {

constexpr double k_peer_silent_s = 10;  ///< the heartbeat comes each second
constexpr std::size_t k_others = 32;    ///< of a hostile network; the longest silent one is forgotten

constexpr double k_now_s = 5;  ///< what is wrong with the link now was heard within that

std::string kind_of(const mavlink::Message& m) {
  return m.is("HEARTBEAT") ? std::string(kind_of_sender(m)) : "other";
}

std::string why_refused(const std::string& kind) {
  if (kind == "unsigned") return "are not signed, and this server has a signing key";
  if (kind == "wrong key") return "are signed with another key than this server's";
  if (kind == "clock behind")
    return "are signed more than a minute ago: the autopilot's clock is not set (it has no GNSS time yet), "
           "or "
           "this server's is wrong";
  if (kind == "replayed") return "are signed with a time that was there before: recorded, and sent again";
  return "";
}

}  // namespace

PeerGate::PeerGate(const std::optional<mavlink::Secret>& secret) {
  if (!secret) return;
  book_ = std::make_shared<mavlink::SignatureBook>(*secret);
  stranger_.require_signature(book_);
  stream_.require_signature(book_);
}

void PeerGate::change(const std::string& sender) {
  peer_.reset();
  vehicle_ = {0, 0};
  armed_ = false;
  wanted_ = sender.empty() ? std::nullopt : std::optional(sender);
}

void PeerGate::expect(double now_s, const DroneIdentity& aircraft) {
  change("");
  peer_ = aircraft.peer;
  vehicle_ = {static_cast<std::uint8_t>(aircraft.system), static_cast<std::uint8_t>(aircraft.component)};
  armed_ = true;
  last_seen_s_ = now_s;
}

void PeerGate::note(const std::string& sender, mavlink::Address from, const std::string& kind, double now_s) {
  auto& seen = others_[{sender, from.system, from.component}];
  if (seen.frames == 0 || kind != "other") seen.kind = kind;
  ++seen.frames;
  seen.last_s = now_s;
  if (others_.size() <= k_others) return;
  others_.erase(std::min_element(others_.begin(), others_.end(), [](const auto& a, const auto& b) {
    return a.second.last_s < b.second.last_s;
  }));
}

/// The frames in it; what was refused is counted, and noted with its sender.
std::vector<mavlink::Received> PeerGate::read(mavlink::Framer& framer, const std::string& sender,
                                              double now_s, std::span<const std::uint8_t> bytes) {
  const auto before = framer.counters();
  std::vector<mavlink::Received> in;
  framer.feed(bytes, in);
  const auto& after = framer.counters();
  if (const auto n =
          after.unsigned_refused - before.unsigned_refused + after.bad_signature - before.bad_signature;
      n > 0) {
    refused_ += n;
    note(sender, {0, 0},
         after.wrong_key > before.wrong_key ? "wrong key"
         : after.behind > before.behind     ? "clock behind"
         : after.replayed > before.replayed ? "replayed"
                                            : "unsigned",
         now_s);
  }
  return in;
}

bool PeerGate::may_take(const mavlink::Received& heartbeat, const std::string& sender, double now_s) const {
  if (!is_our_kind(heartbeat.message) || (wanted_ && *wanted_ != sender)) return false;
  if (!peer_) return true;
  if (now_s - last_seen_s_ <= k_peer_silent_s) return false;
  return !armed_ || heartbeat.from == vehicle_;
}

bool PeerGate::admits(double now_s, std::int64_t unix_us, const std::string& sender,
                      std::span<const std::uint8_t> bytes) {
  if (book_) book_->set_time(mavlink::signature_time(unix_us));
  const bool of_peer = peer_ && *peer_ == sender;
  auto& framer = of_peer ? stream_ : stranger_;
  const auto in = read(framer, sender, now_s, bytes);
  if (!sender.empty()) stranger_.drop_partial();
  bool taken = of_peer;
  for (const auto& one : in) {
    const bool heartbeat = is_our_kind(one.message), beats = one.message.is("HEARTBEAT");
    const bool is_vehicle = of_peer && one.from == vehicle_;
    if (!is_vehicle && may_take(one, sender, now_s)) {
      peer_ = sender;
      wanted_.reset();
      vehicle_ = one.from;
      stream_.drop_partial();
      others_.erase({sender, one.from.system, one.from.component});
      taken = true;
    }
    if (taken && one.from == vehicle_ && (heartbeat || !beats)) {
      if (!heartbeat) continue;
      others_.erase({sender, one.from.system, one.from.component});
      last_seen_s_ = now_s;
      armed_ = (one.message.integer("base_mode") & 0x80) != 0;
    } else {
      note(sender, one.from, kind_of(one.message), now_s);
    }
  }
  if (in.empty() && !taken && !book_) note(sender, {0, 0}, "no MAVLink", now_s);
  return taken;
}

std::string PeerGate::trouble(double now_s, bool connected) const {
  std::string out;
  double newest_s = now_s - k_now_s;
  for (const auto& [who, seen] : others_) {
    const auto& [sender, system, component] = who;
    const bool itself =
        peer_ && sender == *peer_ && system == vehicle_.system && component == vehicle_.component;
    if ((connected && !itself) || seen.last_s < newest_s) continue;
    std::string why;
    if (is_another_vehicle(seen.kind)) {
      why = "system " + std::to_string(system) + (sender.empty() ? "" : " at " + sender) + " is of kind " +
            seen.kind + ": anchord commands multirotors only, it is not followed";
    } else if (const auto refused = why_refused(seen.kind); !refused.empty()) {
      why = "frames " + (sender.empty() ? std::string("on the link") : "of " + sender) + ' ' + refused;
    }
    if (why.empty()) continue;
    out = std::move(why);
    newest_s = seen.last_s;
  }
  return out;
}

std::vector<OtherOnLink> PeerGate::others(double now_s) const {
  std::vector<OtherOnLink> out;
  for (const auto& [who, seen] : others_) {
    const auto& [sender, system, component] = who;
    out.push_back({sender, system, component, seen.kind, seen.frames, std::max(0.0, now_s - seen.last_s)});
  }
  return out;
}

}  // namespace anchord::drone
