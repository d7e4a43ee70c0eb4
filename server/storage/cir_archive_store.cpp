#include <atomic>

#include "core/ports/measurement_store.hpp"
#include "server/storage/measurement_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

// What a mission has is what its appends counted, as in measurement_store.cpp.
constexpr const char* k_due =
    "SELECT m.id FROM mission m WHERE m.state = ?1 AND m.finished_t_ns < ?2 AND m.mission_key NOT IN (SELECT "
    "mission_key FROM mission_bin) AND NOT EXISTS (SELECT 1 FROM cir_archive a WHERE a.mission_key = "
    "m.mission_key AND (a.held = 1 OR a.n_ranges = (SELECT CAST(coalesce(sum(d.n_ranges), 0) AS BIGINT) / 2 "
    "FROM device_seen d WHERE d.mission_key = m.mission_key))) ORDER BY m.finished_t_ns, m.mission_key LIMIT "
    "?3";
constexpr const char* k_cir_archive_state = "SELECT state FROM mission WHERE mission_key = ?1";
constexpr const char* k_one =
    "SELECT n_ranges, held, file, place, sha256_hex, file_bytes, n_cirs, n_moved, archived_t_ns FROM "
    "cir_archive WHERE mission_key = ?1";
constexpr const char* k_list =
    "SELECT m.id, m.name, a.n_ranges, a.held, a.file, a.place, a.sha256_hex, a.file_bytes, a.n_cirs, "
    "a.n_moved, a.archived_t_ns FROM cir_archive a JOIN mission m ON m.mission_key = a.mission_key WHERE "
    "a.file <> '' AND m.mission_key NOT IN (SELECT mission_key FROM mission_bin) ORDER BY a.archived_t_ns "
    "DESC, m.mission_key DESC";
constexpr const char* k_cir_archive_put =
    "INSERT INTO cir_archive (mission_key, n_ranges, held, file, place, sha256_hex, file_bytes, n_cirs, "
    "n_moved, archived_t_ns) VALUES (?1, ?2, 0, ?3, ?4, ?5, ?6, ?7, 0, ?8) ON CONFLICT (mission_key) DO "
    "UPDATE SET n_ranges = excluded.n_ranges, held = 0, file = excluded.file, place = excluded.place, "
    "sha256_hex = excluded.sha256_hex, file_bytes = excluded.file_bytes, n_cirs = excluded.n_cirs, "
    "archived_t_ns = excluded.archived_t_ns";
constexpr const char* k_gone_through = "UPDATE cir_archive SET n_ranges = ?2 WHERE mission_key = ?1";
constexpr const char* k_hold = "UPDATE cir_archive SET held = 1 WHERE mission_key = ?1";
constexpr const char* k_count_moved = "UPDATE cir_archive SET n_moved = n_moved + ?2 WHERE mission_key = ?1";
constexpr const char* k_take_out = "DELETE FROM cir WHERE range_id = ?1";
constexpr const char* k_cir_archive_take_back =
    "DELETE FROM cir_moved WHERE range_id = ?1 RETURNING range_id";
constexpr BulkTable k_moved{"cir_moved", "range_id, digest"};

/// No number of ranges: whoever looks finds that there is more to do.
constexpr std::int64_t k_unfinished = -1;
/// Rows of a page that is read, and of a transaction: some 10 ms of the one writer.
constexpr std::size_t k_page = 256, k_slice = 100;

/// A range whose impulse response is in the file that was written.
struct Filed {
  std::int64_t range_id{};
  CirDigest digest{};
};

/// The columns of k_one behind the first.
ArchivedCirs read_one(Query& query) {
  ArchivedCirs out;
  out.held = query.integer() != 0;
  out.file = query.text();
  out.place = query.text();
  out.sha256_hex = query.text();
  out.file_bytes = query.as<std::uint64_t>();
  out.n_cirs = query.as<std::uint64_t>();
  out.n_moved = query.as<std::uint64_t>();
  out.archived = query.time();
  return out;
}

Error stopped() { return make_error(Errc::canceled, "stopped; nothing is lost, and the next call goes on"); }

class SqlCirArchive final : public CirArchive {
 public:
  SqlCirArchive(Gate& gate, const CirFolder& files, MeasurementStore& measurements)
      : gate_(gate), files_(files), measurements_(measurements) {
    files_.remove_parts();
  }

  Result<std::vector<MissionId>> due(UtcTime landed_before, std::size_t most) override {
    return read_value<std::vector<MissionId>>(gate_, [&](Connection& c) -> Result<std::vector<MissionId>> {
      Query query(c, k_due);
      query << static_cast<int>(MissionState::finished) << landed_before << row_limit(most);
      std::vector<MissionId> out;
      while (query.step()) out.push_back(query.id<MissionId>());
      return out;
    });
  }

  Result<ArchivedCirs> archive(const MissionId& mission, UtcTime now, const GoOn& go_on) override {
    const Alone alone(busy_);
    if (!alone) return being_moved();
    BOOST_OUTCOME_TRYV(check_finished(mission));
    // Before its rows are read: one that comes meanwhile makes another number.
    BOOST_OUTCOME_TRY(const std::uint64_t n_ranges, measurements_.count_ranges(mission));
    BOOST_OUTCOME_TRY(const auto before, one(mission));
    if (before && before->n_ranges == static_cast<std::int64_t>(n_ranges) && !before->cirs.held &&
        (before->cirs.file.empty() || before->cirs.here))
      return before->cirs;
    std::vector<Filed> filed;
    BOOST_OUTCOME_TRY(const auto written, write_file(mission, filed, go_on));
    ArchivedCirs entry;
    entry.mission = mission;
    entry.archived = now;
    entry.n_cirs = filed.size();
    if (written) {
      entry.file = written->file.filename().string();
      entry.place = files_.place();
      entry.sha256_hex = written->sha256_hex;
      entry.file_bytes = written->bytes;
    }
    BOOST_OUTCOME_TRYV(
        put(mission, entry, filed.empty() ? static_cast<std::int64_t>(n_ranges) : k_unfinished));
    for (std::size_t at = 0; at < filed.size(); at += k_slice) {
      if (!go_on()) return stopped();
      BOOST_OUTCOME_TRYV(move(mission, std::span(filed).subspan(at, std::min(k_slice, filed.size() - at))));
    }
    if (!written) return entry;
    if (!go_on()) return stopped();
    BOOST_OUTCOME_TRYV(set(mission, k_gone_through, static_cast<std::int64_t>(n_ranges)));
    files_.remove_others(mission, written->file);
    return entry_of(mission);
  }

  Result<ArchivedCirs> bring_back(const MissionId& mission, const GoOn& go_on) override {
    const Alone alone(busy_);
    if (!alone) return being_moved();
    BOOST_OUTCOME_TRYV(entry_of(mission));
    BOOST_OUTCOME_TRYV(set(mission, k_hold));
    MeasurementStore::Filter filter = all_of(mission);
    for (;;) {
      BOOST_OUTCOME_TRY(const auto page, measurements_.ranges(filter));
      for (std::size_t at = 0; at < page.rows.size(); at += k_slice) {
        if (!go_on()) return stopped();
        BOOST_OUTCOME_TRYV(put_back(mission, page, at, std::min(at + k_slice, page.rows.size())));
      }
      if (page.next.empty()) return entry_of(mission);
      filter.after = page.next;
    }
  }

  Result<std::vector<ArchivedCirs>> list() override {
    return read_value<std::vector<ArchivedCirs>>(gate_,
                                                 [&](Connection& c) -> Result<std::vector<ArchivedCirs>> {
                                                   Query query(c, k_list);
                                                   std::vector<ArchivedCirs> out;
                                                   while (query.step()) {
                                                     const auto mission = query.id<MissionId>();
                                                     std::string name = query.text();
                                                     query.skip();
                                                     out.push_back(read_one(query));
                                                     out.back().mission = mission;
                                                     out.back().mission_name = std::move(name);
                                                     out.back().here = !files_.files(mission).empty();
                                                   }
                                                   return out;
                                                 });
  }

 private:
  /// Whether nobody else is at work; so until it ends.
  class Alone {
   public:
    explicit Alone(std::atomic<bool>& busy) : busy_(busy), mine_(!busy.exchange(true)) {}
    ~Alone() {
      if (mine_) busy_ = false;
    }
    Alone(const Alone&) = delete;
    Alone& operator=(const Alone&) = delete;
    explicit operator bool() const { return mine_; }

   private:
    std::atomic<bool>& busy_;
    const bool mine_;
  };
  static Error being_moved() {
    return make_error(Errc::conflict, "impulse responses of a flight are being moved: try again later");
  }

  static MeasurementStore::Filter all_of(const MissionId& mission) {
    MeasurementStore::Filter filter;
    filter.mission = mission;
    filter.with_cir = true;
    filter.limit = k_page;
    return filter;
  }

  Result<void> check_finished(const MissionId& mission) {
    BOOST_OUTCOME_TRYV(read_value<bool>(gate_, [&](Connection& c) -> Result<bool> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      Query query(c, k_cir_archive_state);
      query << *key;
      if (query.step() && query.one_of(k_mission_state_words) == MissionState::finished) return true;
      return make_error(Errc::conflict, "mission " + to_string(mission) + " has not landed: finish it first");
    }));
    return boost::outcome_v2::success();
  }

  /// Of every impulse response of the flight, wherever it is now. Nothing where there is none.
  Result<std::optional<CirFileWriter::Written>> write_file(const MissionId& mission,
                                                           std::vector<Filed>& filed, const GoOn& go_on) {
    std::unique_ptr<CirFileWriter> file;
    MeasurementStore::Filter filter = all_of(mission);
    for (;;) {
      if (!go_on()) return stopped();
      BOOST_OUTCOME_TRY(const auto page, measurements_.ranges(filter));
      for (std::size_t i = 0; i < page.rows.size(); ++i) {
        const Range& range = page.rows[i];
        if (!range.cir) continue;
        if (file == nullptr) {
          BOOST_OUTCOME_TRY(file, CirFileWriter::create(files_, mission));
        }
        BOOST_OUTCOME_TRYV(file->add(range));
        filed.push_back({page.ids[i], digest_of(*range.cir)});
      }
      if (page.next.empty()) break;
      filter.after = page.next;
    }
    if (file == nullptr) return std::optional<CirFileWriter::Written>{};
    if (!go_on()) return stopped();
    BOOST_OUTCOME_TRY(auto written, file->finish());
    std::vector<CirDigest> digests;
    digests.reserve(filed.size());
    for (const auto& one : filed) digests.push_back(one.digest);
    if (auto checked = check_cir_file(written.file, digests, go_on); !checked) {
      // A file that is wrong must not be taken for the newest.
      std::error_code ignored;
      std::filesystem::remove(written.file, ignored);
      return std::move(checked).error();
    }
    return std::optional(std::move(written));
  }

  /// Takes those out of the database that are there as the file has them.
  Result<void> move(const MissionId& mission, std::span<const Filed> slice) {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      std::vector<const Filed*> out;
      for (const Filed& one : slice) {
        const StoredCir stored = read_cir(c, one.range_id);
        if (stored.cir && digest_of(*stored.cir) == one.digest) out.push_back(&one);
      }
      if (out.empty()) return std::nullopt;
      c.insert_rows(k_moved, out.size(), [&](Query& query, std::size_t i) {
        query << out[i]->range_id << std::as_bytes(std::span(out[i]->digest));
      });
      for (const Filed* one : out) {
        Query query(c, k_take_out);
        query << one->range_id;
        query.run();
      }
      count_moved(c, *key, static_cast<std::int64_t>(out.size()));
      return std::nullopt;
    });
  }

  Result<void> put_back(const MissionId& mission, const MeasurementStore::Page<Range>& page, std::size_t from,
                        std::size_t until) {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      std::vector<std::size_t> back;
      for (std::size_t i = from; i < until; ++i) {
        if (!page.rows[i].cir) continue;
        Query query(c, k_cir_archive_take_back);
        query << page.ids[i];
        if (query.returned()) back.push_back(i);
      }
      if (back.empty()) return std::nullopt;
      c.insert_rows(k_cirs, back.size(), [&](Query& query, std::size_t i) {
        bind_cir(query, page.ids[back[i]], *page.rows[back[i]].cir);
      });
      count_moved(c, *key, -static_cast<std::int64_t>(back.size()));
      return std::nullopt;
    });
  }

  static void count_moved(Connection& c, std::int64_t key, std::int64_t more) {
    Query query(c, k_count_moved);
    query << key << more;
    query.run();
  }

  Result<void> put(const MissionId& mission, const ArchivedCirs& entry, std::int64_t n_ranges) {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      Query query(c, k_cir_archive_put);
      query << *key << n_ranges << entry.file << entry.place << entry.sha256_hex << entry.file_bytes
            << entry.n_cirs << entry.archived;
      query.run();
      return std::nullopt;
    });
  }

  Result<void> set(const MissionId& mission, const char* text,
                   const std::optional<std::int64_t>& value = std::nullopt) {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      Query query(c, text);
      query << *key;
      if (value) query << *value;
      query.run();
      return std::nullopt;
    });
  }

  struct Entry {
    ArchivedCirs cirs;
    std::int64_t n_ranges{};
  };
  Result<std::optional<Entry>> one(const MissionId& mission) {
    return read_value<std::optional<Entry>>(gate_, [&](Connection& c) -> Result<std::optional<Entry>> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      Query query(c, k_one);
      query << *key;
      if (!query.step()) return std::optional<Entry>{};
      Entry out;
      out.n_ranges = query.integer();
      out.cirs = read_one(query);
      out.cirs.mission = mission;
      out.cirs.here = !files_.files(mission).empty();
      return std::optional(std::move(out));
    });
  }
  /// errors: not_found
  Result<ArchivedCirs> entry_of(const MissionId& mission) {
    BOOST_OUTCOME_TRY(auto found, one(mission));
    if (found && !found->cirs.file.empty()) return std::move(found->cirs);
    return make_error(Errc::not_found,
                      "mission " + to_string(mission) + " has no impulse responses in a file");
  }

  Gate& gate_;
  const CirFolder files_;
  MeasurementStore& measurements_;
  std::atomic<bool> busy_{false};
};

}  // namespace

std::unique_ptr<CirArchive> make_cir_archive(Gate& gate, const CirFolder& files,
                                             MeasurementStore& measurements) {
  return std::make_unique<SqlCirArchive>(gate, files, measurements);
}

}  // namespace anchord::sql
