#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "api/bundles/routes.hpp"
#include "api/formats/bundle_manifest.hpp"
#include "core/ports/bundle_store.hpp"

namespace anchord {
struct Site;
}

namespace anchord::api {

class SpoolFolder;

struct SiteBundle {
  std::filesystem::path file;
  std::string digest;  ///< as its manifest has it
};
/// Everything of a site in one file in the folder, or all but its flights. Flights that record are left out
/// and named.
/// errors: those of make_bundle; unsupported (more than a bundle may have)
Result<SiteBundle> make_site_bundle(BundleApi& api, const Site& site, const Principal& who,
                                    const SpoolFolder& folder, bool with_flights);

/// What became of a site's bundle: of its own rows, and of each flight.
struct SiteImport {
  struct Flight {
    MissionId mission{};
    std::string name;
    std::optional<BundleOutcome> outcome;  ///< none: refused
    std::string refused;                   ///< why
  };
  BundleOutcome site;
  std::vector<Flight> flights;
  bool added() const;
};

/// Nothing is taken before all of it was checked; then each flight is taken as a whole, and one that cannot
/// be does not keep the others out. errors: bad_frame, naming the entry; those of BundleStore::take_site
Result<SiteImport> take_site_bundle(BundleApi& api, const Request& request, const ZipReader& zip,
                                    const SiteManifest& manifest, const SpoolFolder& folder);

}  // namespace anchord::api
