#include "core/ports/exclusion_store.hpp"

#include <algorithm>

#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_exclusion_insert =
    "INSERT INTO exclusion (id, mission_key, kind, since_t_ns, until_t_ns, anchor, tag, n_rows, reason, "
    "created_t_ns, created_by) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11) RETURNING exclusion_key";
constexpr const char* k_insert_row =
    "INSERT INTO exclusion_row (exclusion_key, t_ns, tag, anchor, antenna) VALUES (?1, ?2, ?3, ?4, ?5) ON "
    "CONFLICT DO NOTHING";
constexpr const char* k_range =
    "SELECT t_ns, tag, anchor, antenna FROM uwb_range WHERE range_id = ?1 AND mission_key = ?2";
constexpr const char* k_fix = "SELECT t_ns, 0, 0, 0 FROM fix WHERE fix_id = ?1 AND mission_key = ?2";
constexpr const char* k_exclusion_count_ranges =
    "SELECT count(*) FROM uwb_range WHERE mission_key = ?1 AND (?2 IS NULL OR t_ns >= ?2) AND (?3 IS NULL OR "
    "t_ns < ?3) AND (?4 IS NULL OR anchor = ?4) AND (?5 IS NULL OR tag = ?5)";
constexpr const char* k_exclusion_count_fixes =
    "SELECT count(*) FROM fix WHERE mission_key = ?1 AND (?2 IS NULL OR t_ns >= ?2) AND (?3 IS NULL OR t_ns "
    "< "
    "?3)";
constexpr const char* k_exclusion_columns =
    "SELECT e.exclusion_key, e.id, m.id, e.kind, e.since_t_ns, e.until_t_ns, e.anchor, e.tag, e.n_rows, "
    "e.reason, e.created_t_ns, e.created_by, t.t_ns, t.taken_back_by, t.reason FROM exclusion e JOIN mission "
    "m "
    "ON m.mission_key = e.mission_key LEFT JOIN exclusion_taken_back t ON t.exclusion_key = e.exclusion_key ";
constexpr const char* k_exclusion_rows =
    "SELECT t_ns, tag, anchor, antenna FROM exclusion_row WHERE exclusion_key = ?1 ORDER BY t_ns, tag, "
    "anchor, "
    "antenna";
constexpr const char* k_exclusion_take_back =
    "INSERT INTO exclusion_taken_back (exclusion_key, reason, t_ns, taken_back_by) SELECT e.exclusion_key, "
    "?3, "
    "?4, ?5 FROM exclusion e JOIN mission m ON m.mission_key = e.mission_key WHERE e.id = ?1 AND m.id = ?2 "
    "ON "
    "CONFLICT DO NOTHING RETURNING exclusion_key";

RowKey read_key(Query& query) {
  const UtcTime time = query.time();
  const NetworkId tag = query.network_id(), anchor = query.network_id();
  return row_key(time, tag, anchor, query.as<std::uint8_t>());
}

Exclusion read_exclusion(Connection& c, Query& query) {
  Exclusion e;
  const std::int64_t key = query.integer();
  e.id = query.id<ExclusionId>();
  e.mission = query.id<MissionId>();
  e.selection.kind = query.one_of(k_row_kind_words);
  e.selection.since = query.maybe_time();
  e.selection.until = query.maybe_time();
  e.selection.anchor = query.maybe([&] { return query.network_id(); });
  e.selection.tag = query.maybe([&] { return query.network_id(); });
  e.n_rows = query.as<std::uint64_t>();
  e.reason = query.text();
  e.created = query.time();
  e.by = query.text();
  if (const auto time = query.maybe_time()) {
    e.included.emplace();
    e.included->time = *time;
    e.included->by = query.text();
    e.included->reason = query.text();
  }
  Query rows(c, k_exclusion_rows);
  rows << key;
  while (rows.step()) e.selection.rows.push_back(read_key(rows));
  return e;
}

Error no_row(const Exclusion& e, const std::string& which) {
  return make_error(Errc::not_found, std::string("no ") +
                                         (e.selection.kind == RowKind::ranges ? "range" : "position") + ' ' +
                                         which + " of mission " + to_string(e.mission));
}

class SqlExclusionStore final : public ExclusionStore {
 public:
  explicit SqlExclusionStore(Gate& gate) : gate_(gate) {}

  Result<Exclusion> insert(const Exclusion& wanted, const std::vector<std::int64_t>& row_ids) override {
    return write_value<Exclusion>(gate_, row_ids.size() + 1, [&](Connection& c) -> Result<Exclusion> {
      Exclusion e = wanted;
      const auto mission = mission_key(c, e.mission);
      if (!mission) return make_error(Errc::not_found, "no mission " + to_string(e.mission));
      const bool ranges = e.selection.kind == RowKind::ranges;
      for (const std::int64_t id : row_ids) {
        Query query(c, ranges ? k_range : k_fix);
        query << id << *mission;
        if (!query.step()) return no_row(e, std::to_string(id));
        e.selection.rows.push_back(read_key(query));
      }
      std::ranges::sort(e.selection.rows);
      const auto twice = std::ranges::unique(e.selection.rows);
      e.selection.rows.erase(twice.begin(), twice.end());
      e.n_rows = e.selection.rows.empty() ? count(c, *mission, e.selection) : e.selection.rows.size();
      if (e.n_rows == 0) return no_row(e, "in the selection");
      const auto& s = e.selection;
      Query query(c, k_exclusion_insert);
      query << e.id << *mission << static_cast<int>(s.kind) << s.since << s.until << s.anchor << s.tag
            << e.n_rows << e.reason << e.created << e.by;
      const std::int64_t key = query.returned().value();
      Query row(c, k_insert_row);
      for (const RowKey& one : s.rows) {
        row.again();
        row << key << one.time << one.tag << one.anchor << one.antenna;
        row.run();
      }
      return e;
    });
  }

  Result<Exclusion> include(const MissionId& mission, const ExclusionId& id,
                            const Exclusion::Included& word) override {
    return write_value<Exclusion>(gate_, 1, [&](Connection& c) -> Result<Exclusion> {
      Query query(c, k_exclusion_take_back);
      query << id << mission << word.reason << word.time << word.by;
      const bool done = query.returned().has_value();
      Query found(c, std::string(k_exclusion_columns) + "WHERE e.id = ?1 AND m.id = ?2");
      found << id << mission;
      if (!found.step()) return make_error(Errc::not_found, "no exclusion " + to_string(id));
      Exclusion e = read_exclusion(c, found);
      if (done) return e;
      return make_error(Errc::conflict, "exclusion " + to_string(id) + " was taken back at " +
                                            to_rfc3339(e.included->time) + " by " + e.included->by);
    });
  }

  Result<std::vector<Exclusion>> exclusions(const MissionId& mission) override {
    return read_value<std::vector<Exclusion>>(gate_, [&](Connection& c) -> Result<std::vector<Exclusion>> {
      Query query(c, std::string(k_exclusion_columns) + "WHERE m.id = ?1 ORDER BY e.exclusion_key");
      query << mission;
      std::vector<Exclusion> found;
      while (query.step()) found.push_back(read_exclusion(c, query));
      return found;
    });
  }

 private:
  static std::uint64_t count(Connection& c, std::int64_t mission, const RowSelection& s) {
    const bool ranges = s.kind == RowKind::ranges;
    Query query(c, ranges ? k_exclusion_count_ranges : k_exclusion_count_fixes);
    query << mission << s.since << s.until;
    if (ranges) query << s.anchor << s.tag;
    return query.step() ? query.as<std::uint64_t>() : 0;
  }

  Gate& gate_;
};

}  // namespace

std::unique_ptr<ExclusionStore> make_exclusion_store(Gate& gate) {
  return std::make_unique<SqlExclusionStore>(gate);
}

}  // namespace anchord::sql
