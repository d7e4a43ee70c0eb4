#include "api/bundles/bundle_import.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/bundle_notes.hpp"
#include "core/base/text.hpp"
#include "core/ports/event_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

/// Every table once, those that came later at most once, and beside them notes alone.
Result<void> check_tables(const BundleStore& store, const BundleManifest& manifest) {
  std::string wrong;
  for (const auto& table : store.tables()) {
    if (!table.later && std::ranges::find(manifest.entries, bundle_entry_name(table), &BundleEntry::name) ==
                            manifest.entries.end())
      wrong += (wrong.empty() ? "" : ", ") + bundle_entry_name(table) + " is missing";
  }
  for (const auto& entry : manifest.entries) {
    const bool table = std::ranges::any_of(
        store.tables(), [&](const BundleTable& t) { return bundle_entry_name(t) == entry.name; });
    if (!table && !entry.name.starts_with(k_bundle_notes))
      wrong += (wrong.empty() ? "" : ", ") + entry.name + " is not part of a bundle";
  }
  if (!wrong.empty()) return make_error(Errc::bad_frame, wrong);
  return boost::outcome_v2::success();
}

}  // namespace

Result<BundleManifest> checked_flight(const BundleStore& store, const ZipReader& zip) {
  BOOST_OUTCOME_TRY(auto manifest, checked_bundle(zip));
  BOOST_OUTCOME_TRYV(check_tables(store, manifest));
  return manifest;
}

Result<BundleOutcome> take_flight(BundleApi& api, const Request& request, const ZipReader& zip,
                                  const BundleManifest& manifest) {
  BOOST_OUTCOME_TRY(const auto events, noted_events(zip, manifest));
  BundleZipSource source(zip);
  BOOST_OUTCOME_TRY(auto outcome, api.bundles.take_in(manifest.mission, source));
  // After the rows: sent again, the same bundle brings what this may have missed.
  BOOST_OUTCOME_TRYV(api.events.append(events));
  api.audit(request, "bundle.import " + to_string(manifest.mission) + " sha256:" + bundle_digest(manifest),
            outcome.added() ? "ok" : "already here");
  if (outcome.added())
    api.taken(
        manifest.mission,
        to_utf8(manifest.mission_name, 200) + " was imported from a bundle, by " + request.principal.name,
        std::ranges::any_of(outcome.tables,
                            [](const auto& table) { return table.name == "revision" && table.n_added > 0; }));
  return outcome;
}

Ordered outcome_json(const BundleOutcome& outcome) {
  Ordered rows = Ordered::object(), added = Ordered::object(), left_out = Ordered::array();
  for (const auto& table : outcome.tables) {
    if (table.n_rows > 0) rows[table.name] = table.n_rows;
    if (table.n_added > 0) added[table.name] = table.n_added;
  }
  for (const auto& one : outcome.left_out) left_out.push_back({{"what", one.what}, {"why", one.why}});
  return {{"already", !outcome.added()},
          {"rows", std::move(rows)},
          {"added", std::move(added)},
          {"left_out", std::move(left_out)}};
}

}  // namespace anchord::api
