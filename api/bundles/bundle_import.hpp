#pragma once

#include <string>

#include "api/bundles/routes.hpp"
#include "api/formats/bundle.hpp"
#include "core/ports/bundle_store.hpp"

namespace anchord::api {

/// A flight's bundle that is just what it says and has every table once.
/// errors: bad_frame, unsupported, those of the zip file
Result<BundleManifest> checked_flight(const BundleStore& store, const ZipReader& zip);

/// Takes it: rows, then the events of the flight. Audited, announced where it was not here.
/// errors: bad_frame (a note), those of BundleStore::take_in
Result<BundleOutcome> take_flight(BundleApi& api, const Request& request, const ZipReader& zip,
                                  const BundleManifest& manifest);

/// Rows as they came and were added, by table, and what was left out.
nlohmann::ordered_json outcome_json(const BundleOutcome& outcome);

}  // namespace anchord::api
