// Finished flights, as bundles.
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>

#include "api/formats/bundle.hpp"
#include "core/base/sha256.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"
#include "server/sync/taken.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

/// Tables of a bundle whose change sends a flight again. The others are of the surroundings, and of
/// calibrations, which are compared by their ids: else each flight of a kit would send all before it again.
constexpr std::array<std::string_view, 8> k_own_tables{
    "mission", "mission_tag", "mission_procedure", "uwb_range",
    "fix",     "exclusion",   "exclusion_row",     "exclusion_taken_back"};

struct Bundle {
  std::string digest;      ///< of all of it, as the centre names it
  std::string own_digest;  ///< of the flight's own tables
  std::string bytes;
};

Result<Bundle> read_bundle(std::string bytes) {
  BOOST_OUTCOME_TRY(const auto text, manifest_of(bytes));
  BOOST_OUTCOME_TRY(const auto manifest, api::read_bundle_manifest(text));
  Sha256 own;
  for (const auto& entry : manifest.entries) {
    for (const auto table : k_own_tables)
      if (entry.name == api::bundle_entry_name(BundleTable{std::string(table), {}}))
        own.add(entry.name + ' ' + entry.sha256_hex + '\n');
  }
  return Bundle{api::bundle_digest(manifest), own.hex(), std::move(bytes)};
}

class Flights {
 public:
  Flights(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome)
      : field_(field),
        centre_(centre),
        options_(options),
        out_(outcome),
        taken_(options.state_file, centre.url()) {}

  Result<void> run() {
    BOOST_OUTCOME_TRY(auto missions, field_.list("/api/v1/missions?fields=id,name,state"));
    std::ranges::reverse(missions);  // oldest first: revisions rest on those before them
    std::set<std::string> finished;
    for (const auto& mission : missions)
      if (text_of(mission, "state") == "finished") finished.insert(text_of(mission, "id"));
    BOOST_OUTCOME_TRYV(compare_calibrations(finished));
    for (const auto& mission : missions) {
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
    for (const auto& [id, sent] : sent_) ++(sent ? out_.flights_sent : out_.flights_there);
    return boost::outcome_v2::success();
  }

 private:
  /// Calibrations that are not at the centre, and whose flights can all be there.
  Result<void> compare_calibrations(const std::set<std::string>& finished) {
    BOOST_OUTCOME_TRY(const auto ours, field_.list("/api/v1/calibrations?fields=id,missions"));
    BOOST_OUTCOME_TRY(const auto known, centre_.list("/api/v1/calibrations?fields=id"));
    std::set<std::string> there;
    for (const auto& calibration : known) there.insert(text_of(calibration, "id"));
    for (const auto& calibration : ours) {
      const auto id = text_of(calibration, "id");
      if (there.contains(id)) continue;
      std::set<std::string> of;
      for (const auto& mission : member(calibration, "missions"))
        if (mission.is_string()) of.insert(mission.get<std::string>());
      if (std::ranges::includes(finished, of)) missing_[id] = std::move(of);
    }
    return boost::outcome_v2::success();
  }

  void later(const Json& mission) {
    ++out_.flights_recording;
    options_.report("flight \"" + text_of(mission, "name") + "\" is not finished: it is sent by a later run");
  }

  bool has_missing_calibration(const std::string& mission) const {
    return std::ranges::any_of(missing_, [&](const auto& one) { return one.second.contains(mission); });
  }

  Result<void> send(const Json& mission) {
    const auto id = text_of(mission, "id"), name = "flight \"" + text_of(mission, "name") + '"';
    BOOST_OUTCOME_TRY(
        auto made,
        field_.call({.method = "GET", .target = "/api/v1/missions/" + id + "/bundle", .bundle = true}));
    if (made.status != 200) return failed(name, made);
    BOOST_OUTCOME_TRY(const auto bundle, read_bundle(std::move(made.body)));
    if (taken_.has(id, bundle.own_digest)) {
      // It may have been removed there since, or the centre be another one at the same address.
      BOOST_OUTCOME_TRY(const auto there, centre_.call({"GET", "/api/v1/missions/" + id}));
      if (there.status == 200) {
        sent_.emplace(id, false);
        return boost::outcome_v2::success();
      }
    }
    tried_.insert(id);
    if (options_.dry_run) {
      std::erase_if(missing_, [&](const auto& one) { return one.second.contains(id); });
      options_.report(name + ": would send " + megabytes(bundle.bytes.size()));
      return boost::outcome_v2::success();
    }
    options_.report(name + ": " + megabytes(bundle.bytes.size()));
    BOOST_OUTCOME_TRY(const auto answer, centre_.call({.method = "POST",
                                                       .target = "/api/v1/bundles",
                                                       .body = bundle.bytes,
                                                       .type = api::k_bundle_type,
                                                       .bundle = true}));
    if (answer.status == 404 || answer.status == 405)
      return make_error(Errc::unsupported, centre_.url() + " does not accept flight bundles (" +
                                               in_words(answer) +
                                               "): it is older than this program, update it");
    if (answer.status != 200 && answer.status != 201) return failed(name, answer);
    return arrived(id, name, bundle, Json::parse(answer.body, nullptr, false));
  }

  Result<void> arrived(const std::string& id, const std::string& name, const Bundle& bundle,
                       const Json& answer) {
    if (text_of(answer, "mission") != id || text_of(answer, "digest") != "sha256:" + bundle.digest)
      return centre_.stranger("POST /api/v1/bundles",
                              "the answer does not belong to the bundle that was sent");
    std::set<std::string> left_out;
    for (const auto& left : member(answer, "left_out")) {
      const auto what = text_of(left, "what");
      if (what.starts_with("revision ")) continue;  // positions are compared one by one, after the flights
      left_out.insert(what);
      options_.report(name + ": " + what + " left out: " + text_of(left, "why"));
    }
    std::erase_if(missing_, [&](const auto& one) {
      return one.second.contains(id) && !left_out.contains("calibration " + one.first);
    });
    std::uint64_t rows = 0;
    for (const auto& n : member(answer, "added")) rows += n.is_number_unsigned() ? n.get<std::uint64_t>() : 0;
    sent_[id] = sent_[id] || rows > 0;
    options_.report(name + ": " +
                    (rows > 0 ? std::to_string(rows) + " rows stored" : std::string("already there")));
    if (const auto noted = taken_.note(id, bundle.own_digest); !noted)
      options_.report(noted.error().message + "; the next run sends this flight again");
    return boost::outcome_v2::success();
  }

  Result<void> failed(const std::string& name, const server::ClientResponse& answer) {
    refused(out_, options_, name + ": " + in_words(answer));
    return boost::outcome_v2::success();
  }

  Peer& field_;
  Peer& centre_;
  const SyncOptions& options_;
  Outcome& out_;
  Taken taken_;
  std::set<std::string> tried_;       ///< flights whose bundle was sent in this run, or would be
  std::map<std::string, bool> sent_;  ///< flights that are there: whether something of them came now
  std::map<std::string, std::set<std::string>> missing_;  ///< calibrations not at the centre: their flights
};

}  // namespace

Result<void> send_flights(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome) {
  return Flights(field, centre, options, outcome).run();
}

}  // namespace anchord::sync
