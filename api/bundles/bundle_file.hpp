#pragma once

#include <filesystem>

#include "api/bundles/routes.hpp"
#include "api/formats/bundle.hpp"
#include "core/ports/bundle_store.hpp"

namespace anchord::api {

class SpoolFolder;

/// Rows a table may have: what one transaction takes in without the server's other writes waiting for long.
inline constexpr std::uint64_t k_bundle_rows = 5'000'000;
inline constexpr std::uint64_t k_bundle_bytes = std::uint64_t{2} << 30;  ///< of the file

/// A bundle in the folder; its path. errors: those of BundleStore::write_out and ZipWriter
Result<std::filesystem::path> make_bundle(BundleApi& api, const Mission& mission, const Principal& who,
                                          const SpoolFolder& folder);

/// Rows of a bundle whose digests were checked.
class BundleZipSource final : public BundleSource {
 public:
  explicit BundleZipSource(const ZipReader& zip) : zip_(zip) {}
  Result<void> open(const BundleTable& table) override;
  Result<bool> next(BundleRow& row) override;

 private:
  const ZipReader& zip_;
  const BundleTable* table_{nullptr};
  std::optional<ZipLines> lines_;
  std::size_t width_{};  ///< columns of its entry
};

}  // namespace anchord::api
