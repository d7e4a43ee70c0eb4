// Sites without their flights: frames, plans, anchors, buildings, floors and pictures of their plans.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "api/formats/bundle_manifest.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/spool.hpp"
#include "server/sync/sync.hpp"
#include "server/sync/taken.hpp"
#include "server/sync/transfer.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

class Sites {
 public:
  explicit Sites(Run& run) : run_(run), taken_(run.options.state_file, run.centre.url()) {}

  Result<void> send_all() {
    if (!run_.up()) {
      for (const auto& site : run_.sites) {
        BOOST_OUTCOME_TRYV(send(site.id, "site \"" + site.name + '"'));
      }
      return boost::outcome_v2::success();
    }
    // Of the others a flight has all there is.
    BOOST_OUTCOME_TRY(const auto buildings, run_.field.list("/api/v1/buildings?fields=site"));
    std::set<std::string> sites;
    for (const auto& building : buildings) sites.insert(text_of(building, "site"));
    for (const auto& id : sites) {
      BOOST_OUTCOME_TRYV(send(id, "site " + id + " with its floors"));
    }
    return boost::outcome_v2::success();
  }

 private:
  static std::string bundle_path(const std::string& id) {
    return path_of("sites", id, "/bundle?flights=false");
  }
  Result<void> failed(const std::string& what, const server::ClientResponse& answer) {
    run_.failed(what + ": " + sync::in_words(answer));
    return boost::outcome_v2::success();
  }
  /// Of the bundle in the file, which must be of this site and without flights.
  static Result<std::string> digest_of(const Peer& peer, const std::string& id, const Spool& file) {
    const auto text = manifest_of(file);
    if (!text) return peer.stranger(bundle_path(id), text.error().message);
    const auto manifest = api::read_site_manifest(text.value());
    if (!manifest) return peer.stranger(bundle_path(id), manifest.error().message);
    if (to_string(manifest.value().site) != id)
      return peer.stranger(bundle_path(id),
                           "the bundle is of another site, " + to_string(manifest.value().site));
    for (const auto& entry : manifest.value().entries)
      if (entry.name.starts_with(api::k_bundle_flights))
        return peer.stranger(bundle_path(id), "the bundle has flights, which were not asked for");
    return api::site_bundle_digest(manifest.value());
  }

  /// What the field has of it, as a digest; empty: nothing.
  Result<std::string> at_field(const std::string& id) {
    BOOST_OUTCOME_TRY(const auto fetched, fetch_bundle(run_, run_.field, bundle_path(id)));
    if (fetched.answer.status != 200) return std::string();
    return digest_of(run_.field, id, fetched.file);
  }

  /// It may have been removed there since, or the centre be another one at the same address, or one that came
  /// back from an older backup.
  Result<bool> has_been_sent(const std::string& id, const std::string& digest) {
    if (!run_.up() || !taken_.has(id, digest)) return false;
    BOOST_OUTCOME_TRY(const auto there, run_.target().call({"GET", path_of("sites", id)}));
    if (there.status != 200) return false;
    BOOST_OUTCOME_TRY(const auto buildings, run_.field.list("/api/v1/buildings?fields=id&site=" + id));
    BOOST_OUTCOME_TRY(bool all, has_all("/api/v1/buildings?fields=id&site=" + id, buildings, "id"));
    for (const auto& building : buildings) {
      if (!all) return false;
      const auto path = "/api/v1/floors?fields=id&building=" + text_of(building, "id");
      BOOST_OUTCOME_TRY(const auto floors, run_.field.list(path));
      BOOST_OUTCOME_TRY(all, has_all(path, floors, "id"));
    }
    // A frame whose name another one has there stays out.
    for (const auto& [kind, key] : {std::pair("plans", "id"), std::pair("frames", "name")}) {
      if (!all) return false;
      const auto path = "/api/v1/" + std::string(kind) + "?fields=site," + key;
      BOOST_OUTCOME_TRY(auto listed, run_.field.list(path));
      std::erase_if(listed, [&](const Json& one) { return text_of(one, "site") != id; });
      BOOST_OUTCOME_TRY(all, has_all(path, listed, key));
    }
    return all;
  }
  /// Whether the centre lists all of these.
  Result<bool> has_all(const std::string& path, const std::vector<Json>& ours, const char* key) {
    if (ours.empty()) return true;
    BOOST_OUTCOME_TRY(const auto theirs, run_.centre.list(path));
    std::set<std::string> there;
    for (const auto& one : theirs) there.insert(text_of(one, key));
    return std::ranges::all_of(ours, [&](const Json& one) { return there.contains(text_of(one, key)); });
  }

  Result<void> send(const std::string& id, const std::string& what) {
    std::string known;
    if (!run_.up()) {
      BOOST_OUTCOME_TRY(known, at_field(id));
      if (known.empty() && run_.options.dry_run) {
        run_.report(what + ": would be taken");
        return boost::outcome_v2::success();
      }
    }
    BOOST_OUTCOME_TRY(const auto fetched, fetch_bundle(run_, run_.source(), bundle_path(id), known));
    const auto& [made, file] = fetched;
    if (made.status == 304) return there(id, known);
    if (!run_.up() && (made.status == 404 || made.status == 405 || made.status == 422))
      return make_error(Errc::unsupported, run_.centre.url() + " does not give bundles of sites (" +
                                               sync::in_words(made) +
                                               "): it is older than this program, update it");
    if (made.status != 200) return failed(what, made);
    BOOST_OUTCOME_TRY(const auto digest, digest_of(run_.source(), id, file));
    BOOST_OUTCOME_TRY(const bool sent, has_been_sent(id, digest));
    if (sent || digest == known) return there(id, digest);
    if (run_.options.dry_run) {
      run_.report(what + (run_.up() ? ": would send " : ": would take ") + megabytes(file.bytes()));
      return boost::outcome_v2::success();
    }
    run_.report(what + ": " + megabytes(file.bytes()));
    BOOST_OUTCOME_TRY(const auto answer, send_bundle(run_, file, api::k_site_bundle_type));
    if (answer.status != 200 && answer.status != 201) return failed(what, answer);
    return arrived(id, what, digest, json_of(answer));
  }

  Result<void> there(const std::string& id, const std::string& digest) {
    ++run_.outcome.sites_there;
    return note(id, digest);
  }
  Result<void> note(const std::string& id, const std::string& digest) {
    if (run_.options.dry_run || taken_.has(id, digest)) return boost::outcome_v2::success();
    if (const auto noted = taken_.note(id, digest); !noted)
      run_.report(noted.error().message + "; the next run sends this site again");
    return boost::outcome_v2::success();
  }

  Result<void> arrived(const std::string& id, const std::string& what, const std::string& digest,
                       const Json& answer) {
    if (text_of(answer, "site") != id || text_of(answer, "digest") != "sha256:" + digest)
      return run_.target().stranger("POST /api/v1/bundles",
                                    "the answer does not belong to the bundle that was sent");
    for (const auto& left : member(answer, "left_out"))
      run_.left_out(what, text_of(left, "what"), text_of(left, "why"));
    ++(member(answer, "already") == true ? run_.outcome.sites_there : run_.outcome.sites_sent);
    return note(id, digest);
  }

  Run& run_;
  Taken taken_;
};

}  // namespace

Result<void> send_sites(Run& run) { return Sites(run).send_all(); }

}  // namespace anchord::sync
