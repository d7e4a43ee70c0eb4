#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "api/formats/zip_archive.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"

/// What a bundle says of itself (docs/formats.md): whose it is, and the size and digest of every entry.
namespace anchord::api {

inline constexpr std::string_view k_bundle_manifest = "manifest.json";
inline constexpr std::string_view k_bundle_notes = "notes/";
inline constexpr const char* k_bundle_type = "application/vnd.anchord.bundle+zip";
inline constexpr int k_bundle_version = 1;

struct BundleEntry {
  std::string name;
  std::uint64_t bytes{}, rows{};
  std::string sha256_hex;
};
struct BundleManifest {
  MissionId mission{};
  std::string mission_name, made_by;
  UtcTime made{};
  std::vector<BundleEntry> entries;  ///< all but the manifest
};

/// SHA-256 over version, mission, and name and digest of every table: the same flight has the same, whenever
/// and wherever it was written, whatever the notes tell.
std::string bundle_digest(const BundleManifest& manifest);
std::string write_bundle_manifest(const BundleManifest& manifest);
/// errors: bad_frame (no manifest, or its own digest differs), unsupported (made by a newer format)
Result<BundleManifest> read_bundle_manifest(std::string_view text);

/// The manifest of a bundle that is just what it says: no entry more or less, every size and digest right.
/// Reads all of it. errors: bad_frame, naming each entry that differs; unsupported
Result<BundleManifest> checked_bundle(const ZipReader& zip);

inline constexpr const char* k_site_bundle_type = "application/vnd.anchord.site-bundle+zip";
inline constexpr std::string_view k_bundle_flights = "missions/";

/// Of a site with its flights, each a bundle of its own in it.
struct SiteManifest {
  struct LeftOut {
    MissionId mission{};
    std::string name, why;
  };
  SiteId site{};
  std::string site_name, made_by;
  UtcTime made{};
  std::vector<BundleEntry> entries;  ///< all but the manifest; flights in the order in which they are taken
  std::vector<LeftOut> left_out;
};

/// Whether the file says that it is a bundle of a site.
bool is_site_bundle(const ZipReader& zip);
std::string site_bundle_digest(const SiteManifest& manifest);
std::string write_site_manifest(const SiteManifest& manifest);
/// As read_bundle_manifest and checked_bundle.
Result<SiteManifest> read_site_manifest(std::string_view text);
Result<SiteManifest> checked_site_bundle(const ZipReader& zip);

}  // namespace anchord::api
