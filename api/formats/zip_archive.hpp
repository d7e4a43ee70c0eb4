#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::api {

/// What a zip file of a stranger may hold; the sizes are of its content, unpacked.
struct ZipLimits {
  std::size_t entries{64};
  std::uint64_t entry_bytes{std::uint64_t{4} << 30};
  std::uint64_t total_bytes{std::uint64_t{8} << 30};
  double ratio{300};  ///< of content to file; deflate alone reaches 1032, rows of measurements about 10
};

struct ZipEntry {
  std::string name;
  std::uint64_t bytes{};
};

/// A zip file, read entry by entry. open() looks at every name and size first and refuses the file as a
/// whole: names that are absolute, climb (..), hold anything but [A-Za-z0-9._/-] or come twice, whatever is
/// no ordinary file (folders, links), encryption, and what goes beyond the limits. Nothing is ever written
/// where a name points. One thread at a time. errors: bad_frame (no zip file, cut off, or refused as above)
class ZipReader {
 public:
  static Result<ZipReader> open(const std::filesystem::path& file, const ZipLimits& limits = {});
  ~ZipReader();
  ZipReader(ZipReader&&) noexcept;
  ZipReader& operator=(ZipReader&&) noexcept;

  const std::vector<ZipEntry>& entries() const { return entries_; }
  bool has(std::string_view name) const;

  /// The bytes of one entry. The reader outlives it. errors: bad_frame (cut off, checksum, longer than said)
  class Stream {
   public:
    ~Stream();
    Stream(Stream&&) noexcept;
    Stream& operator=(Stream&&) noexcept;
    Result<std::size_t> read(std::span<char> buffer);  ///< 0 at the end

   private:
    friend class ZipReader;
    struct File;
    explicit Stream(std::unique_ptr<File> file);
    std::unique_ptr<File> file_;
  };
  /// errors: not_found, bad_frame
  Result<Stream> stream(std::string_view name) const;
  /// A whole entry of at most so many bytes.
  Result<std::string> text(std::string_view name, std::uint64_t most) const;
  /// SHA-256 of an entry's bytes, 64 hex digits.
  Result<std::string> sha256_hex(std::string_view name) const;

 private:
  struct Archive;
  explicit ZipReader(std::unique_ptr<Archive> archive);
  std::unique_ptr<Archive> archive_;
  std::vector<ZipEntry> entries_;
};

/// Makes a zip file of texts and of files, which must stay as they are until finish(). Every entry has the
/// same date, so that the same content gives the same file. errors: storage_unavailable, storage_full
class ZipWriter {
 public:
  static Result<ZipWriter> create(const std::filesystem::path& file);
  ~ZipWriter();  ///< without finish() there is no file
  ZipWriter(ZipWriter&&) noexcept;
  ZipWriter& operator=(ZipWriter&&) noexcept;

  Result<void> add_text(const std::string& name, std::string text);
  /// `packed`: is compressed already, and only stored.
  Result<void> add_file(const std::string& name, const std::filesystem::path& file, bool packed = false);
  Result<void> finish();

 private:
  struct Archive;
  explicit ZipWriter(std::unique_ptr<Archive> archive);
  std::unique_ptr<Archive> archive_;
};

}  // namespace anchord::api
