#include "api/formats/bundle_manifest.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "core/base/line_text.hpp"
#include "core/base/sha256.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using nlohmann::json;

constexpr std::string_view k_format = "anchord-bundle", k_site_format = "anchord-site-bundle";
constexpr std::uint64_t k_manifest_bytes = 4 << 20;

Error manifest_refused(std::string why) { return make_error(Errc::bad_frame, std::move(why)); }

/// A member of the manifest; empty or 0 where it is missing or of another kind, which no digest fits.
std::string text_of(const json& object, const char* key) {
  const auto at = object.is_object() ? object.find(key) : object.end();
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string{};
}
std::uint64_t count_of(const json& object, const char* key) {
  const auto at = object.is_object() ? object.find(key) : object.end();
  return at != object.end() && at->is_number_unsigned() ? at->get<std::uint64_t>() : 0;
}

/// The manifest of this format as JSON. errors: bad_frame, unsupported
Result<json> manifest_json(std::string_view text, std::string_view format, const char* of) {
  json root;
  if (const auto error = parse_json(text, root))
    return manifest_refused("the manifest is not JSON: " + error->detail);
  if (text_of(root, "format") != format)
    return manifest_refused(std::string("the manifest is not that of a ") + of + " bundle");
  if (const auto version = count_of(root, "version"); version != k_bundle_version)
    return make_error(Errc::unsupported, "the bundle is of version " + std::to_string(version) +
                                             " of the format, this server reads " +
                                             std::to_string(k_bundle_version));
  return root;
}

Result<std::string> manifest_text(const ZipReader& zip, const char* of) {
  if (!zip.has(k_bundle_manifest))
    return manifest_refused(std::string("this is not a valid ") + of + " bundle: it has no manifest.json");
  return zip.text(k_bundle_manifest, k_manifest_bytes);
}

nlohmann::ordered_json entries_json(const std::vector<BundleEntry>& entries) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (const auto& entry : entries)
    out.push_back(
        {{"name", entry.name}, {"bytes", entry.bytes}, {"rows", entry.rows}, {"sha256", entry.sha256_hex}});
  return out;
}

Result<std::vector<BundleEntry>> read_entries(const json& root) {
  const auto entries = root.find("entries");
  if (entries == root.end() || !entries->is_array()) return manifest_refused("the manifest has no entries");
  std::vector<BundleEntry> out;
  for (const auto& entry : *entries)
    out.push_back({text_of(entry, "name"), count_of(entry, "bytes"), count_of(entry, "rows"),
                   text_of(entry, "sha256")});
  return out;
}

/// It is told in events and on pages, as the name of the row is.
Result<void> check_name(const char* of, const std::string& name) {
  const auto fault = line_fault(name, record_limits::k_name);
  if (fault == LineFault::none) return boost::outcome_v2::success();
  return manifest_refused(std::string("manifest.json: the name of the ") + of + ' ' +
                          in_words(fault, record_limits::k_name));
}

/// No entry more or less, every size and digest right. Reads all of it.
Result<void> check_entries(const ZipReader& zip, const std::vector<BundleEntry>& entries) {
  std::string wrong;
  const auto add = [&](const std::string& what) { wrong += (wrong.empty() ? "" : "; ") + what; };
  std::set<std::string> named{std::string(k_bundle_manifest)};
  for (const auto& entry : entries) {
    if (!named.insert(entry.name).second) add(to_utf8(entry.name, 80) + " is in the manifest twice");
    const auto at = std::ranges::find(zip.entries(), entry.name, &ZipEntry::name);
    if (at == zip.entries().end()) {
      add(to_utf8(entry.name, 80) + " is missing");
      continue;
    }
    if (at->bytes != entry.bytes) {
      add(entry.name + " has " + std::to_string(at->bytes) + " bytes, not " + std::to_string(entry.bytes));
      continue;
    }
    const auto sum = zip.sha256_hex(entry.name);
    if (!sum)
      add(sum.error().message);
    else if (sum.value() != entry.sha256_hex)
      add(entry.name + " does not have the digest of the manifest");
  }
  for (const auto& entry : zip.entries()) {
    if (!named.contains(entry.name)) add(entry.name + " is not in the manifest");
  }
  if (!wrong.empty()) return manifest_refused("the bundle does not match its manifest: " + wrong);
  return boost::outcome_v2::success();
}

}  // namespace

std::string bundle_digest(const BundleManifest& manifest) {
  Sha256 sum;
  sum.add(std::string(k_format) + ' ' + std::to_string(k_bundle_version) + ' ' + to_string(manifest.mission) +
          '\n');
  for (const auto& entry : manifest.entries) {
    if (!entry.name.starts_with(k_bundle_notes)) sum.add(entry.sha256_hex + "  " + entry.name + '\n');
  }
  return sum.hex();
}

std::string write_bundle_manifest(const BundleManifest& manifest) {
  return to_wire(
             nlohmann::ordered_json{
                 {"format", k_format},
                 {"version", k_bundle_version},
                 {"mission", {{"id", to_string(manifest.mission)}, {"name", manifest.mission_name}}},
                 {"made_at", to_rfc3339(manifest.made)},
                 {"made_by", manifest.made_by},
                 {"digest", "sha256:" + bundle_digest(manifest)},
                 {"entries", entries_json(manifest.entries)}},
             1) +
         '\n';
}

Result<BundleManifest> read_bundle_manifest(std::string_view text) {
  BOOST_OUTCOME_TRY(const json root, manifest_json(text, k_format, "flight"));
  BundleManifest out;
  const auto mission = root.find("mission");
  const auto id = parse_uuid(mission != root.end() ? text_of(*mission, "id") : std::string{});
  if (!id) return manifest_refused("the manifest gives no mission");
  out.mission = MissionId{id.value()};
  out.mission_name = text_of(*mission, "name");
  BOOST_OUTCOME_TRYV(check_name("mission", out.mission_name));
  out.made_by = text_of(root, "made_by");
  BOOST_OUTCOME_TRY(out.entries, read_entries(root));
  if (text_of(root, "digest") != "sha256:" + bundle_digest(out))
    return manifest_refused("the manifest was changed: its digest does not match its entries");
  return out;
}

Result<BundleManifest> checked_bundle(const ZipReader& zip) {
  BOOST_OUTCOME_TRY(const std::string text, manifest_text(zip, "flight"));
  BOOST_OUTCOME_TRY(auto manifest, read_bundle_manifest(text));
  BOOST_OUTCOME_TRYV(check_entries(zip, manifest.entries));
  return manifest;
}

bool is_site_bundle(const ZipReader& zip) {
  const auto text = manifest_text(zip, "site");
  json root;
  return text && !parse_json(text.value(), root) && text_of(root, "format") == k_site_format;
}

std::string site_bundle_digest(const SiteManifest& manifest) {
  Sha256 sum;
  sum.add(std::string(k_site_format) + ' ' + std::to_string(k_bundle_version) + ' ' +
          to_string(manifest.site) + '\n');
  for (const auto& entry : manifest.entries) sum.add(entry.sha256_hex + "  " + entry.name + '\n');
  return sum.hex();
}

std::string write_site_manifest(const SiteManifest& manifest) {
  nlohmann::ordered_json left_out = nlohmann::ordered_json::array();
  for (const auto& one : manifest.left_out)
    left_out.push_back({{"mission", to_string(one.mission)}, {"name", one.name}, {"why", one.why}});
  return to_wire(nlohmann::ordered_json{{"format", k_site_format},
                                        {"version", k_bundle_version},
                                        {"site",
                                         {{"id", to_string(manifest.site)}, {"name", manifest.site_name}}},
                                        {"made_at", to_rfc3339(manifest.made)},
                                        {"made_by", manifest.made_by},
                                        {"digest", "sha256:" + site_bundle_digest(manifest)},
                                        {"left_out", std::move(left_out)},
                                        {"entries", entries_json(manifest.entries)}},
                 1) +
         '\n';
}

Result<SiteManifest> read_site_manifest(std::string_view text) {
  BOOST_OUTCOME_TRY(const json root, manifest_json(text, k_site_format, "site"));
  SiteManifest out;
  const auto site = root.find("site");
  const auto id = parse_uuid(site != root.end() ? text_of(*site, "id") : std::string{});
  if (!id) return manifest_refused("the manifest gives no site");
  out.site = SiteId{id.value()};
  out.site_name = text_of(*site, "name");
  BOOST_OUTCOME_TRYV(check_name("site", out.site_name));
  out.made_by = text_of(root, "made_by");
  BOOST_OUTCOME_TRY(out.entries, read_entries(root));
  if (text_of(root, "digest") != "sha256:" + site_bundle_digest(out))
    return manifest_refused("the manifest was changed: its digest does not match its entries");
  return out;
}

Result<SiteManifest> checked_site_bundle(const ZipReader& zip) {
  BOOST_OUTCOME_TRY(const std::string text, manifest_text(zip, "site"));
  BOOST_OUTCOME_TRY(auto manifest, read_site_manifest(text));
  BOOST_OUTCOME_TRYV(check_entries(zip, manifest.entries));
  return manifest;
}

}  // namespace anchord::api
