#include "api/formats/handover.hpp"

#include <algorithm>
#include <set>

#include "api/formats/bundle.hpp"
#include "api/formats/zip_archive.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::uint64_t k_small_bytes = 1 << 20;
constexpr std::size_t k_hex = 64;

/// Nothing where a line is none of the list.
std::optional<std::vector<PackSum>> read_sums(std::string_view text) {
  std::vector<PackSum> out;
  while (!text.empty()) {
    const auto end = text.find('\n');
    if (end == std::string_view::npos || end < k_hex + 3 || text.substr(k_hex, 2) != "  ")
      return std::nullopt;
    out.push_back({std::string(text.substr(k_hex + 2, end - k_hex - 2)), std::string(text.substr(0, k_hex))});
    text.remove_prefix(end + 1);
  }
  return out;
}

void hold_against_sums(const ZipReader& zip, const std::vector<PackSum>& sums, PackVerdict& verdict) {
  std::set<std::string> named{std::string(k_pack_sums), std::string(k_pack_signature)};
  for (const auto& sum : sums) {
    const std::string name = to_utf8(sum.name, 200);
    if (!named.insert(sum.name).second) verdict.faults.push_back(name + " is in the list twice");
    if (!zip.has(sum.name)) {
      verdict.faults.push_back(name + " is missing");
      continue;
    }
    const auto found = zip.sha256_hex(sum.name);
    if (!found)
      verdict.faults.push_back(found.error().message);
    else if (found.value() != sum.sha256_hex)
      verdict.faults.push_back(name + " was changed: its SHA-256 is " + found.value() +
                               ", in the list it is " + to_utf8(sum.sha256_hex));
  }
  for (const auto& entry : zip.entries()) {
    if (!named.contains(entry.name)) verdict.faults.push_back(entry.name + " is not in the list");
  }
  verdict.n_files = sums.size();
}

void hold_signature(const ZipReader& zip, std::string_view sums, const std::optional<Ed25519Public>& given,
                    PackVerdict& verdict) {
  auto key = given;
  if (!key) {
    verdict.own_key = true;
    const auto pem = zip.text(k_pack_key, k_small_bytes);
    auto own = pem ? Ed25519Public::parse_pem(pem.value()) : Result<Ed25519Public>(pem.error());
    if (!own) {
      verdict.faults.push_back(std::string(k_pack_key) + ": " + own.error().message);
      return;
    }
    key = std::move(own).value();
  }
  verdict.key_id = key->id();
  const auto signature = zip.text(k_pack_signature, k_small_bytes);
  if (!signature)
    verdict.faults.push_back(std::string(k_pack_signature) + ": " + signature.error().message);
  else if (!key->verifies(sums, signature.value()))
    verdict.faults.push_back("the signature does not match key " + verdict.key_id + " over " +
                             std::string(k_pack_sums));
}

}  // namespace

std::string pack_sums(const std::vector<PackSum>& sums) {
  std::string out;
  for (const auto& sum : sums) out += sum.sha256_hex + "  " + sum.name + '\n';
  return out;
}

Result<PackVerdict> verify_pack(const std::filesystem::path& file, const std::optional<Ed25519Public>& key) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(file, none))
    return make_error(Errc::not_found, "there is no file " + file.string());
  BOOST_OUTCOME_TRY(const auto zip, ZipReader::open(file));
  PackVerdict verdict;
  if (zip.has(k_pack_sums)) {
    BOOST_OUTCOME_TRY(const std::string text, zip.text(k_pack_sums, k_small_bytes));
    const auto sums = read_sums(text);
    if (!sums)
      verdict.faults.push_back(std::string(k_pack_sums) + " is not a list of checksums");
    else
      hold_against_sums(zip, *sums, verdict);
    hold_signature(zip, text, key, verdict);
    return verdict;
  }
  verdict.kind = PackVerdict::Kind::bundle;
  if (!zip.has(k_bundle_manifest))
    return make_error(Errc::bad_frame, "this is neither a hand-over pack nor a bundle: it has neither " +
                                           std::string(k_pack_sums) + " nor " +
                                           std::string(k_bundle_manifest));
  const auto hold = [&](const auto& manifest) {
    if (!manifest)
      verdict.faults.push_back(manifest.error().message);
    else
      verdict.n_files = manifest.value().entries.size();
  };
  if (is_site_bundle(zip))
    hold(checked_site_bundle(zip));
  else
    hold(checked_bundle(zip));
  if (key) verdict.faults.emplace_back("a bundle has no signature of its own: give the hand-over pack");
  return verdict;
}

}  // namespace anchord::api
