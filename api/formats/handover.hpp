#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/ed25519.hpp"
#include "core/base/result.hpp"

/// The hand-over pack (docs/formats.md): a zip file with a flight's bundle and the files people read, a list
/// of their SHA-256 as `sha256sum` writes it, and a detached Ed25519 signature of that list.
namespace anchord::api {

inline constexpr std::string_view k_pack_sums = "SHA256SUMS", k_pack_signature = "SHA256SUMS.sig",
                                  k_pack_key = "key.pem", k_pack_contents = "contents.json",
                                  k_pack_bundle = "bundle.anchord";

struct PackSum {
  std::string name, sha256_hex;
};
/// "<64 hex digits>  <name>\n" a file, in this order.
std::string pack_sums(const std::vector<PackSum>& sums);

/// What became of a look at a file somebody was handed.
struct PackVerdict {
  enum class Kind : std::uint8_t { pack, bundle };
  Kind kind{Kind::pack};
  std::size_t n_files{};
  std::string key_id;               ///< of the key that the signature was held against; of a pack
  bool own_key{false};              ///< it was the key in the pack itself: whole, but whose it is stays open
  std::vector<std::string> faults;  ///< each with what differs; empty: it is whole
};

/// Holds a hand-over pack (or a flight bundle alone, which has no signature) against what it says of itself,
/// and its signature against `key`, or the key in it. errors: not_found (no such file), bad_frame
/// (neither of the two, or not readable as a zip file)
Result<PackVerdict> verify_pack(const std::filesystem::path& file, const std::optional<Ed25519Public>& key);

}  // namespace anchord::api
