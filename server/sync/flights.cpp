// Finished flights, as bundles.
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>

#include "api/formats/bundle.hpp"
#include "core/base/sha256.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/spool.hpp"
#include "server/sync/sync.hpp"
#include "server/sync/taken.hpp"
#include "server/sync/transfer.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

/// Tables of a bundle whose change sends a flight again. The others are of the surroundings, and of
/// calibrations, which are compared by their ids: else each flight of a kit would send all before it again.
constexpr std::array<std::string_view, 8> k_own_tables{
    "mission", "mission_tag", "mission_procedure", "uwb_range",
    "fix",     "exclusion",   "exclusion_row",     "exclusion_taken_back"};

struct Bundle {
  Spool file;
  std::string digest;      ///< of all of it, as who takes it names it
  std::string own_digest;  ///< of the flight's own tables
};

class Flights {
 public:
  Flights(Run& run, const std::set<std::string>* calibrations)
      : run_(run), only_(calibrations), taken_(run.options.state_file, run.centre.url()) {}

  Result<void> send_all() {
    if (only_ != nullptr && only_->empty()) return boost::outcome_v2::success();
    BOOST_OUTCOME_TRY(auto missions, run_.source().list("/api/v1/missions?fields=id,name,state"));
    std::ranges::reverse(missions);  // oldest first: revisions rest on those before them
    std::set<std::string> finished;
    for (const auto& mission : missions)
      if (text_of(mission, "state") == "finished") finished.insert(text_of(mission, "id"));
    BOOST_OUTCOME_TRYV(compare_calibrations(finished));
    for (const auto& mission : missions) {
      if (only_ != nullptr) break;
      if (finished.contains(text_of(mission, "id"))) {
        BOOST_OUTCOME_TRYV(send(mission));
      } else {
        later(mission);
      }
    }
    // Of flights that were there before; what a new one brought along is not missing any more.
    for (const auto& mission : missions) {
      const auto id = text_of(mission, "id");
      if (!has_missing_calibration(id) || tried_.contains(id)) continue;
      taken_.forget(id);
      BOOST_OUTCOME_TRYV(send(mission));
    }
    for (const auto& [id, sent] : sent_) ++(sent ? run_.outcome.flights_sent : run_.outcome.flights_there);
    return boost::outcome_v2::success();
  }

 private:
  /// Calibrations that are not at the target, and whose flights can all be there.
  Result<void> compare_calibrations(const std::set<std::string>& finished) {
    BOOST_OUTCOME_TRY(const auto ours, run_.source().list("/api/v1/calibrations?fields=id,missions"));
    BOOST_OUTCOME_TRY(const auto known, run_.target().list("/api/v1/calibrations?fields=id"));
    std::set<std::string> there;
    for (const auto& calibration : known) there.insert(text_of(calibration, "id"));
    for (const auto& calibration : ours) {
      const auto id = text_of(calibration, "id");
      if (there.contains(id) || (only_ != nullptr && !only_->contains(id))) continue;
      std::set<std::string> of;
      for (const auto& mission : member(calibration, "missions"))
        if (mission.is_string()) of.insert(mission.get<std::string>());
      if (std::ranges::includes(finished, of))
        missing_[id] = std::move(of);
      else if (only_ != nullptr)
        run_.report("calibration " + id +
                    " rests on a flight that is not finished: it comes with a later run");
    }
    return boost::outcome_v2::success();
  }

  /// Whether the target still has all of it: it may have been removed there since, or the target be another
  /// one at the same address, or one that came back from an older backup.
  Result<bool> is_there(const std::string& id) {
    BOOST_OUTCOME_TRY(const auto theirs, run_.target().call({"GET", path_of("missions", id)}));
    if (theirs.status != 200) return false;
    BOOST_OUTCOME_TRY(const auto ours, run_.source().get(path_of("missions", id)));
    const auto has = json_of(theirs);
    for (const char* count : {"n_ranges", "n_fixes"}) {
      const Json &here = member(ours, count), &there = member(has, count);
      if (!here.is_number_unsigned() || !there.is_number_unsigned() ||
          there.get<std::uint64_t>() < here.get<std::uint64_t>())
        return false;
    }
    return has_exclusions(path_of("missions", id, "/exclusions?fields=id,included"));
  }

  /// Each that the source has, and taken back where it was.
  Result<bool> has_exclusions(const std::string& path) {
    BOOST_OUTCOME_TRY(const auto ours, run_.source().get(path));
    if (member(ours, "items").empty()) return true;
    BOOST_OUTCOME_TRY(const auto theirs, run_.target().call({"GET", path}));
    if (theirs.status != 200) return false;
    std::map<std::string, bool> taken_back;
    for (const auto& exclusion : member(json_of(theirs), "items"))
      taken_back[text_of(exclusion, "id")] = !member(exclusion, "included").is_null();
    for (const auto& exclusion : member(ours, "items")) {
      const auto there = taken_back.find(text_of(exclusion, "id"));
      if (there == taken_back.end()) return false;
      if (!member(exclusion, "included").is_null() && !there->second) return false;
    }
    return true;
  }

  void later(const Json& mission) {
    ++run_.outcome.flights_recording;
    run_.report("flight \"" + text_of(mission, "name") + "\" is not finished: it is sent by a later run");
  }

  bool has_missing_calibration(const std::string& mission) const {
    return std::ranges::any_of(missing_, [&](const auto& one) { return one.second.contains(mission); });
  }
  void brought(const std::string& mission, const std::set<std::string>& left_out) {
    std::erase_if(missing_, [&](const auto& one) {
      return one.second.contains(mission) && !left_out.contains("calibration " + one.first);
    });
  }

  /// Of the bundle in the file, which must be of this flight.
  Result<Bundle> read_bundle(const std::string& id, const std::string& target, Spool file) const {
    const auto text = manifest_of(file);
    if (!text) return run_.source().stranger(target, text.error().message);
    const auto manifest = api::read_bundle_manifest(text.value());
    if (!manifest) return run_.source().stranger(target, manifest.error().message);
    if (to_string(manifest.value().mission) != id)
      return run_.source().stranger(
          target, "the bundle is of another flight, " + to_string(manifest.value().mission));
    Sha256 own;
    for (const auto& entry : manifest.value().entries) {
      for (const auto table : k_own_tables)
        if (entry.name == api::bundle_entry_name(BundleTable{std::string(table), {}}))
          own.add(entry.name + ' ' + entry.sha256_hex + '\n');
    }
    return Bundle{std::move(file), api::bundle_digest(manifest.value()), own.hex()};
  }

  Result<void> send(const Json& mission) {
    const auto id = text_of(mission, "id"), name = "flight \"" + text_of(mission, "name") + '"';
    if (!run_.up() && run_.options.dry_run) {
      tried_.insert(id);
      brought(id, {});
      run_.report(name + ": would be taken");
      return boost::outcome_v2::success();
    }
    const auto target = path_of("missions", id, "/bundle");
    BOOST_OUTCOME_TRY(auto fetched, fetch_bundle(run_, run_.source(), target));
    if (fetched.answer.status != 200) return failed(name, fetched.answer);
    BOOST_OUTCOME_TRY(const auto bundle, read_bundle(id, target, std::move(fetched.file)));
    if (taken_.has(id, bundle.own_digest)) {
      BOOST_OUTCOME_TRY(const bool there, is_there(id));
      if (there) {
        sent_.emplace(id, false);
        return boost::outcome_v2::success();
      }
    }
    tried_.insert(id);
    const auto size = megabytes(bundle.file.bytes());
    if (run_.options.dry_run) {
      brought(id, {});
      run_.report(name + ": would send " + size);
      return boost::outcome_v2::success();
    }
    run_.report(name + ": " + size);
    BOOST_OUTCOME_TRY(const auto answer, send_bundle(run_, bundle.file, api::k_bundle_type));
    if (answer.status == 404 || answer.status == 405)
      return make_error(Errc::unsupported, run_.target().url() + " does not accept flight bundles (" +
                                               sync::in_words(answer) +
                                               "): it is older than this program, update it");
    if (answer.status != 200 && answer.status != 201) return failed(name, answer);
    return arrived(id, name, bundle, json_of(answer));
  }

  Result<void> arrived(const std::string& id, const std::string& name, const Bundle& bundle,
                       const Json& answer) {
    if (text_of(answer, "mission") != id || text_of(answer, "digest") != "sha256:" + bundle.digest)
      return run_.target().stranger("POST /api/v1/bundles",
                                    "the answer does not belong to the bundle that was sent");
    std::set<std::string> left_out;
    for (const auto& left : member(answer, "left_out")) {
      const auto what = text_of(left, "what");
      // Positions and profiles of kits are compared one by one, after the flights.
      if (what.starts_with("revision ") || what.starts_with("kit_profile ")) continue;
      left_out.insert(what);
      // Comes with the other flight that it rests on, or was not asked for.
      if (only_ != nullptr && what.starts_with("calibration ")) continue;
      run_.left_out(name, what, text_of(left, "why"));
    }
    brought(id, left_out);
    std::uint64_t rows = 0;
    for (const auto& n : member(answer, "added")) rows += n.is_number_unsigned() ? n.get<std::uint64_t>() : 0;
    sent_[id] = sent_[id] || rows > 0;
    run_.report(name + ": " +
                (rows > 0 ? std::to_string(rows) + " rows stored" : std::string("already there")));
    if (const auto noted = taken_.note(id, bundle.own_digest); !noted)
      run_.report(noted.error().message + "; the next run sends this flight again");
    return boost::outcome_v2::success();
  }

  Result<void> failed(const std::string& name, const server::ClientResponse& answer) {
    run_.failed(name + ": " + sync::in_words(answer));
    return boost::outcome_v2::success();
  }

  Run& run_;
  const std::set<std::string>* const only_;
  Taken taken_;
  std::set<std::string> tried_;       ///< flights whose bundle was sent in this run, or would be
  std::map<std::string, bool> sent_;  ///< flights that are there: whether something of them came now
  std::map<std::string, std::set<std::string>> missing_;  ///< calibrations not at the target: their flights
};

}  // namespace

Result<void> send_flights(Run& run, const std::set<std::string>* calibrations) {
  return Flights(run, calibrations).send_all();
}

}  // namespace anchord::sync
