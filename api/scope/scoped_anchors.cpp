// Anchors, what was solved of them, and what was published.
#include <map>
#include <set>

#include "api/scope/scoped.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {
namespace {

class ScopedAnchors final : public AnchorStore {
 public:
  explicit ScopedAnchors(AnchorStore& all) : all_(all) {}
  /// For who flies: an anchor that is heard is there, whosever it is.
  Result<Anchor> find_or_create(NetworkId network_id, UtcTime now) override {
    return seen(all_.find_or_create(network_id, now), network_id);
  }
  Result<void> update(const Anchor& anchor, std::uint64_t expected_version) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(this->anchor(anchor.id));
      if (!current_sites().holds(anchor.site)) return elsewhere("/site of the anchor");
    }
    return all_.update(anchor, expected_version);
  }
  Result<Anchor> anchor(const AnchorId& id) override { return seen(all_.anchor(id), id); }
  Result<Anchor> anchor(NetworkId network_id) override { return seen(all_.anchor(network_id), network_id); }
  Result<std::vector<Anchor>> anchors(std::size_t limit, const std::optional<AnchorId>& after) override {
    return seen_page<Anchor>(
        limit, after, [&](auto n, const auto& from) { return all_.anchors(n, from); },
        [](const Anchor& anchor) -> Result<bool> { return current_sites().holds(anchor.site); },
        [](const Anchor& anchor) { return anchor.id; });
  }

 private:
  template <class I>
  static Result<Anchor> seen(Result<Anchor> found, const I& id) {
    if (found && !current_sites().holds(found.value().site)) return absent("anchor", id);
    return found;
  }
  AnchorStore& all_;
};

/// One is seen by who sees every mission it was made of.
class ScopedCalibrations final : public CalibrationStore {
 public:
  ScopedCalibrations(CalibrationStore& all, MissionStore& missions) : all_(all), missions_(missions) {}
  Result<void> insert(const Calibration& calibration) override {
    std::map<MissionId, bool> known;
    BOOST_OUTCOME_TRY(const bool seen, sees(calibration, known));
    if (!seen) return elsewhere("a calibration of these missions");
    return all_.insert(calibration);
  }
  Result<Calibration> calibration(const CalibrationId& id) override {
    auto found = all_.calibration(id);
    if (!found || current_sites().all()) return found;
    std::map<MissionId, bool> known;
    BOOST_OUTCOME_TRY(const bool seen, sees(found.value(), known));
    if (!seen) return absent("calibration", id);
    return found;
  }
  Result<std::vector<Calibration>> calibrations(std::size_t limit,
                                                const std::optional<CalibrationId>& after) override {
    std::map<MissionId, bool> known;
    return seen_page<Calibration>(
        limit, after, [&](auto n, const auto& from) { return all_.calibrations(n, from); },
        [&](const Calibration& one) { return sees(one, known); },
        [](const Calibration& one) { return one.id; });
  }
  Result<std::string> evidence(const CalibrationId& id) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(calibration(id));
    }
    return all_.evidence(id);
  }
  Result<void> remove(const CalibrationId& id) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRYV(calibration(id));
    }
    return all_.remove(id);
  }

 private:
  Result<bool> sees(const Calibration& calibration, std::map<MissionId, bool>& known) {
    if (current_sites().all()) return true;
    for (const auto& id : calibration.missions) {
      const auto [at, fresh] = known.try_emplace(id);
      if (fresh) {
        BOOST_OUTCOME_TRY(at->second, is_there(missions_.mission(id)));
      }
      if (!at->second) return false;
    }
    return !calibration.missions.empty();
  }
  CalibrationStore& all_;
  MissionStore& missions_;
};

/// A position is seen by who sees its anchor; a revision by who sees an anchor that it moved: their newest
/// one says all that the newest of all says of theirs.
class ScopedRevisions final : public RevisionStore {
 public:
  ScopedRevisions(RevisionStore& all, AnchorStore& anchors) : all_(all), anchors_(anchors) {}
  Result<Revision> publish(const CalibrationId& id, const std::vector<NetworkId>& anchors,
                           std::string_view by, std::string_view note, UtcTime now,
                           const std::vector<Override>& overrides,
                           std::optional<std::uint64_t> decided_on) override {
    if (current_sites().all()) return all_.publish(id, anchors, by, note, now, overrides, decided_on);
    for (const auto& anchor : anchors) {
      BOOST_OUTCOME_TRY(const bool seen, is_there(anchors_.anchor(anchor)));
      if (!seen)
        return make_error(Errc::conflict,
                          to_string(anchor) + " is no anchor of the sites that this token is bound to");
    }
    // Decided on the newest that they see: others came in between, of other anchors.
    BOOST_OUTCOME_TRY(const auto newest, all_.revisions(1, 0));
    BOOST_OUTCOME_TRY(const auto seen, numbers());
    if (decided_on && *decided_on != (seen.empty() ? 0 : *seen.rbegin()))
      return make_error(Errc::conflict, "another revision was published meanwhile: look at it, then publish");
    return all_.publish(id, anchors, by, note, now, overrides, newest.empty() ? 0 : newest.front().number);
  }
  Result<std::vector<Revision>> revisions(std::size_t limit, std::uint64_t before) override {
    if (current_sites().all()) return all_.revisions(limit, before);
    BOOST_OUTCOME_TRY(const auto seen, numbers());
    std::vector<Revision> out;
    for (auto number = seen.rbegin(); number != seen.rend() && out.size() < limit; ++number) {
      if (before != 0 && *number >= before) continue;
      BOOST_OUTCOME_TRY(auto one, all_.revisions(1, *number + 1));
      if (!one.empty() && one.front().number == *number) out.push_back(std::move(one.front()));
    }
    return out;
  }
  Result<std::vector<PublishedPosition>> published(std::optional<std::uint64_t> revision) override {
    if (current_sites().all()) return all_.published(revision);
    if (revision) {
      BOOST_OUTCOME_TRY(const auto seen, numbers());
      if (!seen.contains(*revision))
        return make_error(Errc::not_found, "no revision " + std::to_string(*revision));
    }
    BOOST_OUTCOME_TRY(auto positions, all_.published(revision));
    BOOST_OUTCOME_TRY(const auto own, own_anchors());
    std::erase_if(positions, [&](const auto& position) { return !own.contains(position.estimate.anchor); });
    return positions;
  }
  Result<std::optional<PublishedPosition>> position(NetworkId network_id, std::uint64_t revision) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRY(const bool seen, is_there(anchors_.anchor(network_id)));
      if (!seen) return std::optional<PublishedPosition>{};
    }
    return all_.position(network_id, revision);
  }
  Result<std::vector<PublishedPosition>> history(NetworkId network_id) override {
    if (!current_sites().all()) {
      BOOST_OUTCOME_TRY(const bool seen, is_there(anchors_.anchor(network_id)));
      if (!seen) return std::vector<PublishedPosition>{};
    }
    return all_.history(network_id);
  }
  std::optional<std::uint64_t> changes() const override { return all_.changes(); }

 private:
  Result<std::set<NetworkId>> own_anchors() {
    std::set<NetworkId> out;
    for (std::optional<AnchorId> after;;) {
      BOOST_OUTCOME_TRY(const auto page, anchors_.anchors(1000, after));
      for (const auto& anchor : page) out.insert(anchor.network_id);
      if (page.size() < 1000) return out;
      after = page.back().id;
    }
  }
  /// Of the revisions that moved one of theirs.
  Result<std::set<std::uint64_t>> numbers() {
    std::set<std::uint64_t> out;
    BOOST_OUTCOME_TRY(const auto own, own_anchors());
    for (const auto& anchor : own) {
      BOOST_OUTCOME_TRY(const auto history, all_.history(anchor));
      for (const auto& position : history) out.insert(position.since_revision);
    }
    return out;
  }
  RevisionStore& all_;
  AnchorStore& anchors_;
};

}  // namespace

std::unique_ptr<AnchorStore> scoped_anchors(AnchorStore& all) { return std::make_unique<ScopedAnchors>(all); }
std::unique_ptr<CalibrationStore> scoped_calibrations(CalibrationStore& all, MissionStore& missions) {
  return std::make_unique<ScopedCalibrations>(all, missions);
}
std::unique_ptr<RevisionStore> scoped_revisions(RevisionStore& all, AnchorStore& anchors) {
  return std::make_unique<ScopedRevisions>(all, anchors);
}

}  // namespace anchord::api
