#include "core/flight/control_lease.hpp"

namespace anchord::flight {

std::optional<Lease> ControlLease::holder(const Moment& now) const {
  if (!lease_ || !(now.steady < lease_->until_steady)) return std::nullopt;
  Lease held = *lease_;
  held.until = {now.utc.ns + (held.until_steady.ns - now.steady.ns)};
  return held;
}

bool ControlLease::just_ended(const Moment& now) {
  if (!lease_ || now.steady < lease_->until_steady) return false;
  lease_.reset();
  return true;
}

Result<Lease> ControlLease::take(const MissionId& mission, const Holder& who, const Moment& now,
                                 bool by_force, std::string key) {
  if (const auto held = holder(now); held && !by_force)
    return make_error(Errc::conflict, held->name + " has had control since " + to_rfc3339(held->since));
  lease_ = Lease{mission, std::move(key), who.token_id, who.name, now.utc, {}, later(now.steady, k_lasts_ns)};
  return *holder(now);
}

Result<Lease> ControlLease::renew(const MissionId& mission, const std::string& key, const Holder& who,
                                  const Moment& now) {
  const auto held = holder(now);
  if (!held) return make_error(Errc::conflict, "nobody has control: take control first");
  if (held->mission != mission || held->key != key || held->token_id != who.token_id)
    return make_error(Errc::conflict, held->name + " has had control since " + to_rfc3339(held->since));
  lease_->until_steady = later(now.steady, k_lasts_ns);
  return *holder(now);
}

Result<void> ControlLease::release(const MissionId& mission, const std::string& key, const Holder& who,
                                   const Moment& now) {
  BOOST_OUTCOME_TRYV(renew(mission, key, who, now));
  lease_.reset();
  return boost::outcome_v2::success();
}

}  // namespace anchord::flight
