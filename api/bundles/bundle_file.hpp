#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "api/bundles/bundle_values.hpp"
#include "api/bundles/routes.hpp"
#include "api/formats/bundle.hpp"
#include "core/base/sha256.hpp"
#include "core/ports/bundle_store.hpp"

namespace anchord::api {

class SpoolFolder;

/// Rows a table may have: what one transaction takes in without the server's other writes waiting for long.
inline constexpr std::uint64_t k_bundle_rows = 5'000'000;
inline constexpr std::uint64_t k_bundle_bytes = std::uint64_t{2} << 30;  ///< of the file

inline constexpr std::size_t k_site_entries = 5000;  ///< of a site's bundle

/// Writes the rows into files of a folder, one a table, and an entry of the manifest for each.
class FolderSink final : public BundleSink {
 public:
  FolderSink(const SpoolFolder& folder, std::vector<BundleEntry>& entries)
      : folder_(folder), entries_(entries) {}
  Result<void> begin(const BundleTable& table) override;
  Result<void> row(const BundleRow& row) override;
  /// After the last row.
  Result<void> end();

 private:
  void begin_text(const BundleRow* first);
  Result<void> flush();
  Error failed() const;

  const SpoolFolder& folder_;
  std::vector<BundleEntry>& entries_;
  const BundleTable* table_{nullptr};
  BundleEntry entry_;
  std::ofstream file_;
  Sha256 sum_;
  std::string text_;
  std::optional<std::size_t> width_;  ///< columns, known with the first row
};

struct FlightBundle {
  std::filesystem::path file;
  std::string digest;  ///< of all entries, notes too
};
/// A bundle in the folder. errors: those of BundleStore::write_out and ZipWriter
Result<FlightBundle> make_bundle(BundleApi& api, const Mission& mission, const Principal& who,
                                 const SpoolFolder& folder);

/// Size and digest of a file under this name. errors: storage_unavailable
Result<BundleEntry> entry_of(const std::string& name, const std::filesystem::path& path);

/// Rows of a bundle whose digests were checked.
class BundleZipSource final : public BundleSource {
 public:
  explicit BundleZipSource(const ZipReader& zip) : zip_(zip) {}
  Result<void> open(const BundleTable& table) override;
  Result<bool> next(BundleRow& row) override;

 private:
  const ZipReader& zip_;
  const BundleTable* table_{nullptr};
  std::optional<RowCheck> check_;
  std::optional<ZipLines> lines_;
  std::size_t width_{};  ///< columns of its entry
};

}  // namespace anchord::api
