#include "api/services/control_lease.hpp"

namespace anchord::api {

std::optional<Lease> ControlLease::holder(UtcTime now) const {
  return lease_ && now < lease_->until ? lease_ : std::nullopt;
}

bool ControlLease::just_ended(UtcTime now) {
  if (!lease_ || now < lease_->until) return false;
  lease_.reset();
  return true;
}

Result<Lease> ControlLease::take(const MissionId& mission, const Principal& who, UtcTime now, bool by_force) {
  if (const auto held = holder(now); held && !by_force)
    return make_error(Errc::conflict, held->name + " has control since " + to_rfc3339(held->since));
  lease_ = Lease{mission, to_string(make_uuid_v7(now)), who.token_id, who.name, now, {now.ns + k_lasts_ns}};
  return *lease_;
}

Result<Lease> ControlLease::renew(const MissionId& mission, const std::string& key, const Principal& who,
                                  UtcTime now) {
  const auto held = holder(now);
  if (!held) return make_error(Errc::conflict, "nobody has control; take it first");
  if (held->mission != mission || held->key != key || held->token_id != who.token_id)
    return make_error(Errc::conflict, held->name + " has control since " + to_rfc3339(held->since));
  lease_->until = {now.ns + k_lasts_ns};
  return *lease_;
}

Result<void> ControlLease::release(const MissionId& mission, const std::string& key, const Principal& who,
                                   UtcTime now) {
  BOOST_OUTCOME_TRYV(renew(mission, key, who, now));
  lease_.reset();
  return boost::outcome_v2::success();
}

}  // namespace anchord::api
