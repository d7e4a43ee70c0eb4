#include "server/storage/cir_file.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cstring>

#include "core/base/sha256.hpp"
#include "server/storage/backup.hpp"
#include "server/storage/data_folder.hpp"

namespace anchord::sql {
namespace {

namespace fs = std::filesystem;

constexpr const char *k_suffix = ".db", *k_part = ".part";
/// Of pages of 4 KiB each would have one response, and a third of it empty.
constexpr const char* k_cir_file_schema = R"(
PRAGMA page_size = 65536;
PRAGMA journal_mode = OFF;
PRAGMA synchronous = OFF;
PRAGMA application_id = 0x414e4349;
PRAGMA user_version = 1;
BEGIN;
CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TABLE cir (
  number INTEGER PRIMARY KEY, -- from 1, in the order of time
  t_ns INTEGER NOT NULL, tag INTEGER NOT NULL, anchor INTEGER NOT NULL, antenna INTEGER NOT NULL, seq INTEGER,
  dt_ps REAL NOT NULL, first_path_idx REAL, preamble_count REAL,
  n_bytes INTEGER NOT NULL, -- of re_im: int16 little endian, re, im, re, im, ...
  deflated BLOB NOT NULL    -- re_im by zlib: all lower bytes, then all upper ones
) STRICT;
)";
constexpr const char* k_index =
    "CREATE UNIQUE INDEX cir_identity ON cir (t_ns, tag, anchor, antenna, ifnull(seq, -1)); COMMIT;";
constexpr const char* k_about = "INSERT INTO about VALUES ('mission', ?), ('format', 'docs/operations.md')";
constexpr const char* k_cir_file_insert =
    "INSERT INTO cir (t_ns, tag, anchor, antenna, seq, dt_ps, first_path_idx, preamble_count, n_bytes, "
    "deflated) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)";
constexpr const char* k_cir_file_find =
    "SELECT dt_ps, first_path_idx, preamble_count, n_bytes, deflated FROM cir WHERE t_ns = ? AND tag = ? AND "
    "anchor = ? AND antenna = ? AND ifnull(seq, -1) = ?";
constexpr const char* k_cir_file_all =
    "SELECT dt_ps, first_path_idx, preamble_count, n_bytes, deflated FROM cir ORDER BY number";

/// What a device can have measured, many times over: a damaged length allocates no more.
constexpr std::int64_t k_most_bytes = 1 << 20;

Error to_error(const fs::path& file, const SQLite::Exception& error) {
  const bool full = (error.getErrorCode() & 0xff) == SQLITE_FULL;
  return make_error(full ? Errc::storage_full : Errc::storage_unavailable,
                    file.string() + ": " + error.what());
}

/// The two bytes of a sample apart: the upper ones of noise are nearly all alike. A tenth less than as they
/// are.
std::string planes(const std::vector<std::int16_t>& samples) {
  std::string out(samples.size() * 2, '\0');
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto bits = static_cast<std::uint16_t>(samples[i]);
    out[i] = static_cast<char>(bits & 0xff);
    out[samples.size() + i] = static_cast<char>(bits >> 8);
  }
  return out;
}

std::vector<std::int16_t> samples_of(const std::string& bytes) {
  std::vector<std::int16_t> out(bytes.size() / 2);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto low = static_cast<std::uint8_t>(bytes[i]),
               high = static_cast<std::uint8_t>(bytes[out.size() + i]);
    out[i] = static_cast<std::int16_t>(static_cast<std::uint16_t>(low | high << 8));
  }
  return out;
}

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string out(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                static_cast<uLong>(bytes.size()), Z_DEFAULT_COMPRESSION) != Z_OK)
    throw std::bad_alloc();  // there is no other reason
  out.resize(size);
  return out;
}

/// Nothing where it is not what was written.
std::optional<std::string> inflated(const void* bytes, int n, std::int64_t size) {
  if (size < 0 || size > k_most_bytes || size % 2 != 0) return std::nullopt;
  std::string out(static_cast<std::size_t>(size), '\0');
  uLongf got = static_cast<uLongf>(size);
  if (uncompress(reinterpret_cast<Bytef*>(out.data()), &got, static_cast<const Bytef*>(bytes),
                 static_cast<uLong>(n)) != Z_OK ||
      got != static_cast<uLongf>(size))
    return std::nullopt;
  return out;
}

void bind_maybe(SQLite::Statement& query, int index, const std::optional<double>& value) {
  if (value)
    query.bind(index, *value);
  else
    query.bind(index);
}

std::optional<double> maybe_real(SQLite::Statement& query, int column) {
  return query.isColumnNull(column) ? std::nullopt : std::optional(query.getColumn(column).getDouble());
}

/// The columns of k_cir_file_find and k_cir_file_all.
std::optional<Cir> read_cir(SQLite::Statement& query) {
  const auto blob = query.getColumn(4);
  const auto bytes = inflated(blob.getBlob(), blob.getBytes(), query.getColumn(3).getInt64());
  if (!bytes) return std::nullopt;
  Cir cir;
  cir.dt_ps = query.getColumn(0).getDouble();
  cir.first_path_idx = maybe_real(query, 1);
  cir.preamble_count = maybe_real(query, 2);
  cir.re_im = samples_of(*bytes);
  return cir;
}

/// N of MISSION-N.db; nothing of any other name.
std::optional<std::uint64_t> number_of(const std::string& name, const std::string& mission) {
  if (!name.starts_with(mission + '-') || !name.ends_with(k_suffix)) return std::nullopt;
  const char* const begin = name.data() + mission.size() + 1;
  const char* const end = name.data() + name.size() - std::strlen(k_suffix);
  std::uint64_t number = 0;
  const auto read = std::from_chars(begin, end, number);
  return read.ec == std::errc{} && read.ptr == end ? std::optional(number) : std::nullopt;
}

std::map<std::uint64_t, fs::path, std::greater<>> numbered(const fs::path& dir, const MissionId& mission) {
  std::map<std::uint64_t, fs::path, std::greater<>> out;
  const std::string id = to_string(mission);
  std::error_code error;
  if (dir.empty()) return out;
  for (fs::directory_iterator it(dir, error), end; !error && it != end; it.increment(error)) {
    if (const auto number = number_of(it->path().filename().string(), id)) out.emplace(*number, it->path());
  }
  return out;
}

class CirRowsWriter final : public CirFileWriter {
 public:
  CirRowsWriter(fs::path file, const MissionId& mission)
      : file_(std::move(file)),
        part_(file_.string() + k_part),
        db_(std::make_unique<SQLite::Database>(part_.string(),
                                               SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)) {
    db_->exec(k_cir_file_schema);
    SQLite::Statement about(*db_, k_about);
    about.bind(1, to_string(mission));
    about.exec();
    insert_ = std::make_unique<SQLite::Statement>(*db_, k_cir_file_insert);
  }
  ~CirRowsWriter() override {
    insert_.reset();
    db_.reset();
    std::error_code ignored;
    fs::remove(part_, ignored);
  }

  Result<void> add(const Range& range) override {
    const std::string samples = deflated(planes(range.cir->re_im));
    try {
      SQLite::Statement& query = *insert_;
      query.reset();
      query.bind(1, static_cast<std::int64_t>(range.time.ns));
      query.bind(2, static_cast<std::int64_t>(range.tag.value));
      query.bind(3, static_cast<std::int64_t>(range.anchor.value));
      query.bind(4, static_cast<std::int64_t>(range.antenna));
      if (range.seq)
        query.bind(5, static_cast<std::int64_t>(*range.seq));
      else
        query.bind(5);
      query.bind(6, range.cir->dt_ps);
      bind_maybe(query, 7, range.cir->first_path_idx);
      bind_maybe(query, 8, range.cir->preamble_count);
      query.bind(9, static_cast<std::int64_t>(range.cir->re_im.size() * 2));
      query.bind(10, samples.data(), static_cast<int>(samples.size()));
      query.exec();
    } catch (const SQLite::Exception& error) {
      return to_error(part_, error);
    }
    return boost::outcome_v2::success();
  }

  Result<Written> finish() override {
    try {
      insert_.reset();
      db_->exec(k_index);
      db_.reset();
    } catch (const SQLite::Exception& error) {
      return to_error(part_, error);
    }
    BOOST_OUTCOME_TRYV(sync_path(part_));
    Written written;
    written.file = file_;
    BOOST_OUTCOME_TRY(written.sha256_hex, sha256_of_file(part_));
    std::error_code error;
    written.bytes = fs::file_size(part_, error);
    if (!error) fs::rename(part_, file_, error);
    if (error) return make_error(Errc::storage_unavailable, file_.string() + ": " + error.message());
    BOOST_OUTCOME_TRYV(sync_path(file_.parent_path()));
    return written;
  }

 private:
  const fs::path file_, part_;
  std::unique_ptr<SQLite::Database> db_;
  std::unique_ptr<SQLite::Statement> insert_;
};

}  // namespace

CirDigest digest_of(const Cir& cir) {
  Sha256 digest;
  digest.add(std::uint64_t{cir.re_im.size()});
  digest.add(planes(cir.re_im));
  digest.add(cir.dt_ps);
  for (const auto& value : {cir.first_path_idx, cir.preamble_count}) {
    digest.add(std::uint64_t{value.has_value()});
    digest.add(value.value_or(0));
  }
  return digest.digest();
}

std::string CirFolder::place() const {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0 || host[0] == '\0') host[0] = '?';
  return std::string(host.data()) + ':' + fs::absolute(dir_).lexically_normal().string();
}

std::vector<fs::path> CirFolder::files(const MissionId& mission) const {
  std::vector<fs::path> out;
  for (auto& [number, file] : numbered(dir_, mission)) out.push_back(std::move(file));
  return out;
}

fs::path CirFolder::next(const MissionId& mission) const {
  const auto there = numbered(dir_, mission);
  const std::uint64_t number = there.empty() ? 1 : there.begin()->first + 1;
  return dir_ / (to_string(mission) + '-' + std::to_string(number) + k_suffix);
}

void CirFolder::remove_others(const MissionId& mission, const fs::path& keep) const {
  std::error_code ignored;
  auto gone = files(mission);
  std::erase_if(gone, [&](const fs::path& file) { return file.filename() == keep.filename(); });
  {
    auto holds = holds_->lock();
    if (holds->n > 0) {
      holds->waiting.insert(holds->waiting.end(), gone.begin(), gone.end());
      return;
    }
  }
  // A copy that is begun only now is of a database that needs them no longer.
  for (const auto& file : gone) fs::remove(file, ignored);
}

CirFolder::Hold::Hold(std::shared_ptr<Locked<Holds>> holds) : holds_(std::move(holds)) {
  auto held = holds_->lock();
  ++held->n;
}

CirFolder::Hold::~Hold() {
  std::vector<fs::path> gone;
  {
    auto held = holds_->lock();
    if (--held->n == 0) gone.swap(held->waiting);
  }
  std::error_code ignored;
  for (const auto& file : gone) fs::remove(file, ignored);
}

void CirFolder::remove_parts() const {
  std::error_code error, ignored;
  if (dir_.empty()) return;
  for (fs::directory_iterator it(dir_, error), end; !error && it != end; it.increment(error))
    if (it->path().extension() == k_part) fs::remove(it->path(), ignored);
}

Result<std::unique_ptr<CirFileWriter>> CirFileWriter::create(const CirFolder& folder,
                                                             const MissionId& mission) {
  std::error_code error;
  fs::create_directories(folder.dir(), error);
  if (error) return make_error(Errc::storage_unavailable, folder.dir().string() + ": " + error.message());
  BOOST_OUTCOME_TRYV(sync_path(fs::absolute(folder.dir()).parent_path()));
  const fs::path file = folder.next(mission);
  try {
    return std::unique_ptr<CirFileWriter>(std::make_unique<CirRowsWriter>(file, mission));
  } catch (const SQLite::Exception& thrown) {
    return to_error(file, thrown);
  }
}

Result<void> check_cir_file(const fs::path& file, const std::vector<CirDigest>& digests,
                            const std::function<bool()>& go_on) {
  constexpr std::size_t k_step = 256;
  const auto differs = [&](std::size_t n) {
    return make_error(Errc::storage_unavailable, file.string() + ": impulse response " +
                                                     std::to_string(n + 1) +
                                                     " is not what was written: the disk may be failing");
  };
  try {
    const SQLite::Database db(file.string(), SQLite::OPEN_READONLY);
    SQLite::Statement query(db, k_cir_file_all);
    std::size_t n = 0;
    for (; query.executeStep(); ++n) {
      if (n % k_step == 0 && !go_on()) return make_error(Errc::canceled, "stopped");
      const auto cir = read_cir(query);
      if (!cir || n >= digests.size() || digest_of(*cir) != digests[n]) return differs(n);
    }
    if (n != digests.size()) return differs(n);
  } catch (const SQLite::Exception& error) {
    return to_error(file, error);
  }
  return boost::outcome_v2::success();
}

class CirFinder::File {
 public:
  explicit File(const fs::path& file)
      : db_(file.string(), SQLite::OPEN_READONLY | SQLite::OPEN_NOMUTEX), query_(db_, k_cir_file_find) {}
  std::optional<Cir> find(const Range& range) {
    query_.reset();
    query_.bind(1, static_cast<std::int64_t>(range.time.ns));
    query_.bind(2, static_cast<std::int64_t>(range.tag.value));
    query_.bind(3, static_cast<std::int64_t>(range.anchor.value));
    query_.bind(4, static_cast<std::int64_t>(range.antenna));
    query_.bind(5, range.seq ? static_cast<std::int64_t>(*range.seq) : std::int64_t{-1});
    return query_.executeStep() ? read_cir(query_) : std::nullopt;
  }

 private:
  const SQLite::Database db_;
  SQLite::Statement query_;
};

CirFinder::CirFinder(const CirFolder& folder) : folder_(folder) {}
CirFinder::~CirFinder() = default;

Result<Cir> CirFinder::find(const Range& range, const CirDigest& digest) {
  auto [at, fresh] = open_.try_emplace(range.mission);
  std::string unread;
  try {
    if (fresh)
      for (const auto& file : folder_.files(range.mission))
        at->second.push_back(std::make_unique<File>(file));
    for (const auto& file : at->second) {
      auto cir = file->find(range);
      if (cir && digest_of(*cir) == digest) return *std::move(cir);
    }
  } catch (const SQLite::Exception& error) {
    unread = error.what();
  }
  const std::string id = to_string(range.mission);
  std::string why = "the impulse responses of mission " + id + " were moved out of the database into " +
                    folder_.place() + "/" + id + "-*.db, ";
  if (!unread.empty())
    why += "which cannot be read (" + unread + "): restore the file from a copy";
  else if (at->second.empty())
    why +=
        "which is not there: copy the file into that folder; GET /api/v1/cir-archive shows where it was "
        "written";
  else
    why += "which does not have that of " + to_string(range.tag) + " and " + to_string(range.anchor) +
           " as it was measured: restore the file from a copy";
  open_.erase(at);
  return make_error(Errc::storage_unavailable, std::move(why));
}

}  // namespace anchord::sql
