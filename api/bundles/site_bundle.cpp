#include "api/bundles/site_bundle.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/bundle_import.hpp"
#include "api/bundles/spool.hpp"
#include "core/ports/mission_store.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_missions_a_page = 500, k_copied_bytes = std::size_t{1} << 20;
constexpr std::string_view k_flight_ending = ".anchord";

std::string flight_entry(const MissionId& mission) {
  return std::string(k_bundle_flights) + to_string(mission) + std::string(k_flight_ending);
}

/// Oldest first: revisions rest on those before them.
Result<std::vector<Mission>> missions_of(MissionStore& store, const SiteId& site) {
  std::vector<Mission> out;
  std::optional<MissionId> after;
  for (;;) {
    BOOST_OUTCOME_TRY(const auto page, store.missions(k_missions_a_page, after));
    for (const auto& mission : page)
      if (mission.site == site) out.push_back(mission);
    if (page.size() < k_missions_a_page) break;
    after = page.back().id;
  }
  std::ranges::reverse(out);
  return out;
}

/// The bundle of a flight, out of that of its site.
Result<void> unpack(const ZipReader& zip, const std::string& name, const std::filesystem::path& path) {
  BOOST_OUTCOME_TRY(auto stream, zip.stream(name));
  std::ofstream file(path, std::ios::binary);
  std::vector<char> buffer(k_copied_bytes);
  for (;;) {
    BOOST_OUTCOME_TRY(const std::size_t n, stream.read(buffer));
    if (n == 0) break;
    file.write(buffer.data(), static_cast<std::streamsize>(n));
  }
  file.close();
  if (!file) return make_error(Errc::storage_full, "not enough space for " + name + " of the bundle");
  return boost::outcome_v2::success();
}

struct Flight {
  ZipReader zip;
  BundleManifest manifest;
};

Error in_entry(const std::string& name, const Error& error) {
  return make_error(error.code, name + ": " + error.message);
}

/// Every flight of the bundle, checked. What is neither a flight nor a table of a site is refused.
Result<std::vector<Flight>> flights_of(BundleApi& api, const ZipReader& zip, const SiteManifest& manifest,
                                       const SpoolFolder& folder) {
  std::vector<Flight> out;
  for (const auto& entry : manifest.entries) {
    const bool table = std::ranges::any_of(
        api.bundles.site_tables(), [&](const BundleTable& t) { return bundle_entry_name(t) == entry.name; });
    if (table) continue;
    if (!entry.name.starts_with(k_bundle_flights))
      return make_error(Errc::bad_frame, entry.name + " is not part of a bundle of a site");
    const auto path = folder.path("flight-" + std::to_string(out.size()) + std::string(k_flight_ending));
    BOOST_OUTCOME_TRYV(unpack(zip, entry.name, path));
    auto opened = ZipReader::open(path);
    if (!opened) return in_entry(entry.name, opened.error());
    auto checked = checked_flight(api.bundles, opened.value());
    if (!checked) return in_entry(entry.name, checked.error());
    if (entry.name != flight_entry(checked.value().mission))
      return make_error(Errc::bad_frame,
                        entry.name + " is the bundle of mission " + to_string(checked.value().mission));
    out.push_back({std::move(opened).value(), std::move(checked).value()});
  }
  for (const auto& table : api.bundles.site_tables()) {
    if (table.later || std::ranges::find(manifest.entries, bundle_entry_name(table), &BundleEntry::name) !=
                           manifest.entries.end())
      continue;
    return make_error(Errc::bad_frame, bundle_entry_name(table) + " is missing");
  }
  return out;
}

}  // namespace

bool SiteImport::added() const {
  return site.added() || std::ranges::any_of(flights, [](const Flight& flight) {
           return flight.outcome && flight.outcome->added();
         });
}

Result<SiteBundle> make_site_bundle(BundleApi& api, const Site& site, const Principal& who,
                                    const SpoolFolder& folder, bool with_flights) {
  SiteManifest manifest{site.id, site.name, api.made_by, api.clock.now(), {}, {}};
  FolderSink sink(folder, manifest.entries);
  BOOST_OUTCOME_TRY(api.bundles.write_site(site.id, sink));
  BOOST_OUTCOME_TRYV(sink.end());
  const std::size_t n_tables = manifest.entries.size();
  std::vector<Mission> missions;
  if (with_flights) {
    BOOST_OUTCOME_TRY(missions, missions_of(api.missions, site.id));
  }
  std::vector<std::filesystem::path> files;
  std::uint64_t bytes = 0;
  for (const auto& table : manifest.entries) bytes += table.bytes;
  for (const auto& mission : missions) {
    if (mission.state == MissionState::recording) {
      manifest.left_out.push_back({mission.id, mission.name, "it is recording"});
      continue;
    }
    // A folder of its own: its tables have the names of those of the site.
    BOOST_OUTCOME_TRY(const auto apart, SpoolFolder::make(api.spool));
    BOOST_OUTCOME_TRY(const auto made, make_bundle(api, mission, who, *apart));
    const auto file = folder.path(to_string(mission.id) + std::string(k_flight_ending));
    std::error_code moved;
    std::filesystem::rename(made.file, file, moved);
    if (moved) return make_error(Errc::storage_unavailable, "cannot move a bundle: " + moved.message());
    BOOST_OUTCOME_TRY(auto entry, entry_of(flight_entry(mission.id), file));
    bytes += entry.bytes;
    if (bytes > k_bundle_bytes || manifest.entries.size() >= k_site_entries)
      return make_error(Errc::unsupported,
                        "the flights and floor plans of this site are more than one file may have (2 GiB, " +
                            std::to_string(k_site_entries) + " flights): take the bundle of each flight");
    manifest.entries.push_back(std::move(entry));
    files.push_back(file);
  }
  const auto file = folder.path("site.anchord");
  BOOST_OUTCOME_TRY(auto zip, ZipWriter::create(file));
  BOOST_OUTCOME_TRYV(zip.add_text(std::string(k_bundle_manifest), write_site_manifest(manifest)));
  for (const auto& table : api.bundles.site_tables()) {
    const auto name = bundle_entry_name(table);
    if (std::ranges::find(manifest.entries, name, &BundleEntry::name) == manifest.entries.end()) continue;
    BOOST_OUTCOME_TRYV(zip.add_file(name, folder.path(table.name)));
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    BOOST_OUTCOME_TRYV(zip.add_file(manifest.entries[n_tables + i].name, files[i], true));
  }
  BOOST_OUTCOME_TRYV(zip.finish());
  return SiteBundle{file, site_bundle_digest(manifest)};
}

Result<SiteImport> take_site_bundle(BundleApi& api, const Request& request, const ZipReader& zip,
                                    const SiteManifest& manifest, const SpoolFolder& folder) {
  BOOST_OUTCOME_TRY(const auto flights, flights_of(api, zip, manifest, folder));
  SiteImport out;
  BundleZipSource source(zip);
  BOOST_OUTCOME_TRY(out.site, api.bundles.take_site(manifest.site, source));
  api.audit(request,
            "bundle.import site " + to_string(manifest.site) + " sha256:" + site_bundle_digest(manifest),
            out.site.added() ? "ok" : "already here");
  for (const auto& flight : flights) {
    auto taken = take_flight(api, request, flight.zip, flight.manifest);
    SiteImport::Flight one{flight.manifest.mission, flight.manifest.mission_name, {}, ""};
    if (taken)
      one.outcome = std::move(taken).value();
    else if (taken.error().code == Errc::conflict || taken.error().code == Errc::invalid_argument ||
             taken.error().code == Errc::bad_frame)
      one.refused = taken.error().message;
    else
      return taken.error();  // the store is in trouble: sent again, what is here stays
    out.flights.push_back(std::move(one));
  }
  return out;
}

}  // namespace anchord::api
