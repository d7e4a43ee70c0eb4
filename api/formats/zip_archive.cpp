#include "api/formats/zip_archive.hpp"

#include <zip.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <deque>
#include <set>

#include "core/base/sha256.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

/// Small files may be packed as tightly as they like: a ratio counts from here.
constexpr std::uint64_t k_ratio_from_bytes = std::uint64_t{16} << 20;
constexpr std::size_t k_name_bytes = 200;
constexpr std::size_t k_read_bytes = 64 * 1024;
constexpr std::uint32_t k_file_type = 0170000, k_regular = 0100000;
/// 1 January 2000 in the clock of DOS, which is what a zip file has.
constexpr zip_uint16_t k_dos_time = 0, k_dos_date = (20 << 9) | (1 << 5) | 1;

Error refused(std::string why) { return make_error(Errc::bad_frame, std::move(why)); }

std::string shown(std::string_view name) { return json_text(to_utf8(name, 80)); }

/// Empty, or why an entry may not be called that.
std::string wrong_name(std::string_view name) {
  if (name.empty()) return "an entry has no name";
  if (name.size() > k_name_bytes) return "an entry has a name of " + std::to_string(name.size()) + " bytes";
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-' || c == '/';
  };
  if (!std::ranges::all_of(name, allowed))
    return "the entry " + shown(name) + " has other characters than A-Z a-z 0-9 . _ - /";
  std::size_t from = 0;
  while (from <= name.size()) {
    const auto end = std::min(name.find('/', from), name.size());
    const auto part = name.substr(from, end - from);
    if (part.empty() || part == "." || part == "..")
      return "the entry " + shown(name) + " is not a plain relative file name";
    from = end + 1;
  }
  return {};
}

std::string lower(std::string_view name) {
  std::string out;
  for (const char c : name) out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

/// Empty, or why this entry is none of ours.
std::string wrong_kind(zip_t* archive, zip_uint64_t index, const zip_stat_t& stat, const std::string& name) {
  if ((stat.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && stat.encryption_method != ZIP_EM_NONE)
    return "the entry " + shown(name) + " is encrypted";
  if ((stat.valid & ZIP_STAT_COMP_METHOD) != 0 && stat.comp_method != ZIP_CM_STORE &&
      stat.comp_method != ZIP_CM_DEFLATE)
    return "the entry " + shown(name) + " is compressed by another method than deflate";
  zip_uint8_t system = 0;
  zip_uint32_t attributes = 0;
  if (zip_file_get_external_attributes(archive, index, 0, &system, &attributes) == 0 &&
      system == ZIP_OPSYS_UNIX) {
    const std::uint32_t type = (attributes >> 16) & k_file_type;
    if (type != 0 && type != k_regular) return "the entry " + shown(name) + " is a link or a folder";
  }
  return {};
}

}  // namespace

struct ZipReader::Archive {
  zip_t* zip{nullptr};
  Archive() = default;
  Archive(const Archive&) = delete;
  Archive& operator=(const Archive&) = delete;
  ~Archive() {
    if (zip != nullptr) zip_discard(zip);
  }
};

ZipReader::ZipReader(std::unique_ptr<Archive> archive) : archive_(std::move(archive)) {}
ZipReader::~ZipReader() = default;
ZipReader::ZipReader(ZipReader&&) noexcept = default;
ZipReader& ZipReader::operator=(ZipReader&&) noexcept = default;

Result<ZipReader> ZipReader::open(const std::filesystem::path& file, const ZipLimits& limits) {
  auto archive = std::make_unique<Archive>();
  int code = 0;
  archive->zip = zip_open(file.c_str(), ZIP_RDONLY | ZIP_CHECKCONS, &code);
  if (archive->zip == nullptr) {
    zip_error_t error;
    zip_error_init_with_code(&error, code);
    const std::string why = zip_error_strerror(&error);
    zip_error_fini(&error);
    return refused("this is not a complete zip file: " + why);
  }
  ZipReader reader(std::move(archive));
  zip_t* const zip = reader.archive_->zip;
  const zip_int64_t n = zip_get_num_entries(zip, 0);
  if (n < 0 || static_cast<std::uint64_t>(n) > limits.entries)
    return refused("the zip file has " + std::to_string(n) + " entries, at most " +
                   std::to_string(limits.entries) + " are read");
  std::error_code none;
  const std::uint64_t packed = std::filesystem::file_size(file, none);
  std::set<std::string> names;
  std::uint64_t total = 0;
  for (zip_uint64_t i = 0; i < static_cast<zip_uint64_t>(n); ++i) {
    const char* raw = zip_get_name(zip, i, ZIP_FL_ENC_RAW);
    zip_stat_t stat;
    zip_stat_init(&stat);
    if (raw == nullptr || zip_stat_index(zip, i, 0, &stat) != 0 || (stat.valid & ZIP_STAT_SIZE) == 0)
      return refused("entry " + std::to_string(i) + " of the zip file cannot be read");
    const std::string name = raw;
    if (auto why = wrong_name(name); !why.empty()) return refused(std::move(why));
    if (!names.insert(lower(name)).second) return refused("the entry " + shown(name) + " occurs twice");
    if (auto why = wrong_kind(zip, i, stat, name); !why.empty()) return refused(std::move(why));
    if (stat.size > limits.entry_bytes || (total += stat.size) > limits.total_bytes)
      return refused("the content is too large: " + shown(name) + " has " + std::to_string(stat.size) +
                     " bytes, at most " + std::to_string(limits.entry_bytes) + " are read of an entry and " +
                     std::to_string(limits.total_bytes) + " of all");
    reader.entries_.push_back({name, stat.size});
  }
  if (total > k_ratio_from_bytes && static_cast<double>(total) > limits.ratio * static_cast<double>(packed))
    return refused("the content is more than " + std::to_string(static_cast<int>(limits.ratio)) +
                   " times the file: " + std::to_string(total) + " bytes in " + std::to_string(packed));
  return reader;
}

bool ZipReader::has(std::string_view name) const {
  return std::ranges::find(entries_, name, &ZipEntry::name) != entries_.end();
}

struct ZipReader::Stream::File {
  zip_file_t* file{nullptr};
  std::string name;
  std::uint64_t left{};
  File() = default;
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() {
    if (file != nullptr) zip_fclose(file);
  }
};

ZipReader::Stream::Stream(std::unique_ptr<File> file) : file_(std::move(file)) {}
ZipReader::Stream::~Stream() = default;
ZipReader::Stream::Stream(Stream&&) noexcept = default;
ZipReader::Stream& ZipReader::Stream::operator=(Stream&&) noexcept = default;

Result<std::size_t> ZipReader::Stream::read(std::span<char> buffer) {
  const zip_int64_t n = zip_fread(file_->file, buffer.data(), buffer.size());
  if (n < 0)
    return refused("the entry " + shown(file_->name) +
                   " cannot be read completely: " + std::string(zip_file_strerror(file_->file)));
  if (static_cast<std::uint64_t>(n) > file_->left)
    return refused("the entry " + shown(file_->name) + " is longer than stated");
  file_->left -= static_cast<std::uint64_t>(n);
  if (n == 0 && file_->left > 0) return refused("the entry " + shown(file_->name) + " is cut off");
  return static_cast<std::size_t>(n);
}

Result<ZipReader::Stream> ZipReader::stream(std::string_view name) const {
  const auto at = std::ranges::find(entries_, name, &ZipEntry::name);
  if (at == entries_.end()) return make_error(Errc::not_found, "there is no entry " + shown(name));
  auto file = std::make_unique<Stream::File>();
  file->name = at->name;
  file->left = at->bytes;
  file->file = zip_fopen_index(archive_->zip, static_cast<zip_uint64_t>(at - entries_.begin()), 0);
  if (file->file == nullptr)
    return refused("the entry " + shown(name) +
                   " cannot be read: " + std::string(zip_strerror(archive_->zip)));
  return Stream(std::move(file));
}

Result<std::string> ZipReader::text(std::string_view name, std::uint64_t most) const {
  BOOST_OUTCOME_TRY(auto from, stream(name));
  std::string out;
  std::array<char, 16384> buffer{};
  for (;;) {
    BOOST_OUTCOME_TRY(const std::size_t n, from.read(buffer));
    if (n == 0) return out;
    out.append(buffer.data(), n);
    if (out.size() > most)
      return refused("the entry " + shown(name) + " has more than " + std::to_string(most) + " bytes");
  }
}

Result<std::string> ZipReader::sha256_hex(std::string_view name) const {
  BOOST_OUTCOME_TRY(auto from, stream(name));
  Sha256 sum;
  std::vector<char> buffer(k_read_bytes);
  for (;;) {
    BOOST_OUTCOME_TRY(const std::size_t n, from.read(buffer));
    if (n == 0) return sum.hex();
    sum.add(std::string_view(buffer.data(), n));
  }
}

struct ZipWriter::Archive {
  zip_t* zip{nullptr};
  std::deque<std::string> texts;  ///< read by finish(); their addresses hold
  Archive() = default;
  Archive(const Archive&) = delete;
  Archive& operator=(const Archive&) = delete;
  ~Archive() {
    if (zip != nullptr) zip_discard(zip);
  }
  Error failed(const std::string& what) const {
    zip_error_t* const error = zip_get_error(zip);
    const bool full = zip_error_system_type(error) == ZIP_ET_SYS && zip_error_code_system(error) == ENOSPC;
    return make_error(full ? Errc::storage_full : Errc::storage_unavailable,
                      "cannot write " + what + ": " + zip_error_strerror(error));
  }
  Result<void> add(const std::string& name, zip_source_t* source, bool packed) {
    if (source == nullptr) return failed(name);
    const zip_int64_t index = zip_file_add(zip, name.c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(source);
      return failed(name);
    }
    const auto at = static_cast<zip_uint64_t>(index);
    if (zip_set_file_compression(zip, at, packed ? ZIP_CM_STORE : ZIP_CM_DEFLATE, 0) != 0 ||
        zip_file_set_dostime(zip, at, k_dos_time, k_dos_date, 0) != 0 ||
        zip_file_set_external_attributes(zip, at, 0, ZIP_OPSYS_UNIX, (k_regular | 0600U) << 16) != 0)
      return failed(name);
    return boost::outcome_v2::success();
  }
};

ZipWriter::ZipWriter(std::unique_ptr<Archive> archive) : archive_(std::move(archive)) {}
ZipWriter::~ZipWriter() = default;
ZipWriter::ZipWriter(ZipWriter&&) noexcept = default;
ZipWriter& ZipWriter::operator=(ZipWriter&&) noexcept = default;

Result<ZipWriter> ZipWriter::create(const std::filesystem::path& file) {
  auto archive = std::make_unique<Archive>();
  int code = 0;
  archive->zip = zip_open(file.c_str(), ZIP_CREATE | ZIP_EXCL, &code);
  if (archive->zip == nullptr)
    return make_error(Errc::storage_unavailable,
                      "cannot create a zip file in " + file.parent_path().string());
  return ZipWriter(std::move(archive));
}

Result<void> ZipWriter::add_text(const std::string& name, std::string text) {
  const std::string& kept = archive_->texts.emplace_back(std::move(text));
  return archive_->add(name, zip_source_buffer(archive_->zip, kept.data(), kept.size(), 0), false);
}

Result<void> ZipWriter::add_file(const std::string& name, const std::filesystem::path& file, bool packed) {
  return archive_->add(name, zip_source_file(archive_->zip, file.c_str(), 0, -1), packed);
}

Result<void> ZipWriter::finish() {
  if (zip_close(archive_->zip) != 0) return archive_->failed("the zip file");
  archive_->zip = nullptr;
  return boost::outcome_v2::success();
}

}  // namespace anchord::api
