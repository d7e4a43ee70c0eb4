#include <charconv>
#include <map>

#include "server/storage/measurement_rows.hpp"
#include "server/storage/measurement_sums.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_mission_id = "SELECT id FROM mission WHERE mission_key = ?1";
constexpr const char* k_devices_of_mission =
    "SELECT d.network_id, d.kind, m.id, d.first_t_ns, d.last_t_ns, d.n_ranges "
    "FROM device_seen d JOIN mission m ON m.mission_key = d.mission_key "
    "WHERE m.id = ?1 AND m.mission_key NOT IN (SELECT mission_key FROM mission_bin) ORDER BY d.last_t_ns "
    "DESC, d.network_id";
constexpr const char* k_devices =
    "SELECT d.network_id, d.kind, m.id, d.first_t_ns, d.last_t_ns, d.n_ranges "
    "FROM device_seen d JOIN mission m ON m.mission_key = d.mission_key "
    "WHERE m.mission_key NOT IN (SELECT mission_key FROM mission_bin) ORDER BY d.last_t_ns DESC, "
    "d.network_id";
/// Each row was noted with its two radios, in its own transaction: what a count over the rows gives, without
/// them.
constexpr const char* k_measurement_count_ranges =
    "SELECT CAST(coalesce(sum(n_ranges), 0) AS BIGINT) / 2 FROM device_seen WHERE mission_key = ?1";
constexpr const char* k_count_all_ranges =
    "SELECT CAST(coalesce(sum(n_ranges), 0) AS BIGINT) / 2 FROM device_seen WHERE mission_key NOT IN (SELECT "
    "mission_key FROM mission_bin)";
constexpr const char* k_measurement_count_fixes = "SELECT n_fixes FROM mission_fixes WHERE mission_key = ?1";

class Keys {
 public:
  explicit Keys(Connection& connection) : connection_(connection) {}
  std::optional<std::int64_t> of(const MissionId& id) {
    if (last_ && last_->first == id) return last_->second;
    auto it = known_.find(id);
    if (it == known_.end()) it = known_.emplace(id, mission_key(connection_, id)).first;
    last_ = *it;
    return it->second;
  }

 private:
  Connection& connection_;
  std::map<MissionId, std::optional<std::int64_t>> known_;
  std::optional<std::pair<MissionId, std::optional<std::int64_t>>> last_;
};

/// A row of the call whose mission is known.
struct Known {
  std::size_t at{};
  std::int64_t mission_key{};
};

void store_cirs(Connection& connection, const std::vector<Range>& rows, const std::vector<Known>& known,
                const Connection::Keys& ids) {
  std::vector<std::pair<std::int64_t, const Cir*>> cirs;
  for (std::size_t i = 0; i < known.size(); ++i) {
    const auto& cir = rows[known[i].at].cir;
    if (ids[i] && cir) cirs.emplace_back(*ids[i], &*cir);
  }
  if (cirs.empty()) return;
  connection.insert_rows(k_cirs, cirs.size(), [&](Query& query, std::size_t i) {
    bind_cir(query, cirs[i].first, *cirs[i].second);
  });
}
void store_cirs(Connection&, const std::vector<Fix>&, const std::vector<Known>&, const Connection::Keys&) {}
/// As far as a comparison with `sent` needs it: of a response that is in a file the digest is enough.
void load_cir_beside(Connection& connection, std::int64_t id, const Range& sent, Range& row) {
  StoredCir stored = read_cir(connection, id);
  row.cir = std::move(stored.cir);
  if (stored.moved) row.cir = sent.cir && digest_of(*sent.cir) == *stored.moved ? sent.cir : Cir{};
}
void load_cir_beside(Connection&, std::int64_t, const Fix&, Fix&) {}
Result<void> load_cir(Connection& connection, CirFinder& archive, std::int64_t id, Range& row) {
  StoredCir stored = read_cir(connection, id);
  row.cir = std::move(stored.cir);
  if (stored.moved) {
    BOOST_OUTCOME_TRY(row.cir, archive.find(row, *stored.moved));
  }
  return boost::outcome_v2::success();
}
Result<void> load_cir(Connection&, CirFinder&, std::int64_t, Fix&) { return boost::outcome_v2::success(); }

template <class Row>
RowOutcome judge_stored(Connection& connection, std::int64_t key, const Row& row) {
  static const std::string text = "SELECT " + std::string(Table<Row>::columns) + " FROM " +
                                  std::string(Table<Row>::name) + " WHERE " +
                                  std::string(Table<Row>::same_identity);
  Query query(connection, text);
  Table<Row>::bind_identity(query, key, row);
  if (!query.step()) throw SqlError(Failure::internal, "a row that was rejected as existing does not exist");
  const std::int64_t id = query.integer();
  query.skip();
  Row stored = Table<Row>::read(query);
  load_cir_beside(connection, id, row, stored);
  return same_content(stored, row) ? RowOutcome::duplicate : RowOutcome::conflict;
}

template <class Row>
void append_rows(Connection& connection, const std::vector<Row>& rows, std::vector<RowOutcome>& outcomes) {
  outcomes.assign(rows.size(), RowOutcome::unknown_mission);
  Keys keys(connection);
  std::vector<Known> known;
  known.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (const auto key = keys.of(rows[i].mission)) known.push_back({i, *key});
  }
  const auto ids = connection.insert_rows(Table<Row>::bulk, known.size(), [&](Query& query, std::size_t i) {
    Table<Row>::bind(query, known[i].mission_key, rows[known[i].at]);
  });
  // Before rows are compared with what is stored, which may be one of these.
  store_cirs(connection, rows, known, ids);
  MeasurementSums sums;
  for (std::size_t i = 0; i < known.size(); ++i) {
    const Row& row = rows[known[i].at];
    auto& outcome = outcomes[known[i].at];
    if (ids[i]) {
      outcome = RowOutcome::accepted;
      sums.note(known[i].mission_key, row);
    } else {
      outcome = judge_stored(connection, known[i].mission_key, row);
    }
  }
  sums.store(connection);
}

template <class Row>
Result<std::vector<RowOutcome>> append(Gate& gate, const std::vector<Row>& rows, bool atomic) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string refusal = Table<Row>::refusal(rows[i]);
    if (!refusal.empty())
      return make_error(Errc::invalid_argument, "row " + std::to_string(i) + ": " + refusal);
  }
  std::vector<RowOutcome> outcomes;
  if (rows.empty()) return outcomes;
  bool refused = false;
  const auto error = gate.write(rows.size(), [&](Connection& connection) -> std::optional<Error> {
    append_rows(connection, rows, outcomes);
    refused = atomic && std::ranges::any_of(outcomes, [](RowOutcome outcome) {
                return outcome == RowOutcome::conflict || outcome == RowOutcome::unknown_mission;
              });
    if (refused) return make_error(Errc::conflict, "a row of an atomic call cannot be stored");
    return std::nullopt;
  });
  if (error && !(refused && error->code == Errc::conflict)) return *error;
  return outcomes;
}

struct Cursor {
  std::int64_t t_ns{}, id{};
};

Result<std::optional<Cursor>> parse_cursor(const std::string& text) {
  if (text.empty()) return std::optional<Cursor>{};
  Cursor cursor;
  const char* const end = text.data() + text.size();
  const auto time = std::from_chars(text.data(), end, cursor.t_ns);
  if (time.ec == std::errc{} && time.ptr != end && *time.ptr == '.') {
    const auto id = std::from_chars(time.ptr + 1, end, cursor.id);
    if (id.ec == std::errc{} && id.ptr == end) return std::optional(cursor);
  }
  return make_error(Errc::invalid_argument, "not a cursor of this server: \"" + text + "\"");
}

constexpr LimitColumns k_range_limits{"distance_m", "ifnull(rx_dbm, rss_dbm)", "truth_los"};
/// Class of the newest position at most 2 s before a range; 0, none, where there is no such.
constexpr const char* k_fix_class =
    "ifnull((SELECT f.fix_class FROM fix f WHERE f.mission_key = uwb_range.mission_key AND f.t_ns <= "
    "uwb_range.t_ns AND f.t_ns >= uwb_range.t_ns - 2000000000 ORDER BY f.t_ns DESC, ifnull(f.seq, -1) DESC "
    "LIMIT 1), 0) = ";
/// The same from the other side, for one mission: a span for each position of the class, up to the next
/// position. A class that a flight hardly had costs what it had, not a look at every range.
constexpr const char* k_spans_of_class =
    "(SELECT f.fix_id AS span_id, f.t_ns AS from_ns, (SELECT ifnull(min(g.t_ns), f.t_ns + 2000000001) FROM "
    "fix g WHERE g.mission_key = f.mission_key AND g.t_ns > f.t_ns AND g.t_ns <= f.t_ns + 2000000000) AS "
    "until_ns FROM fix f WHERE f.mission_key = ?1 AND NOT EXISTS (SELECT 1 FROM fix g WHERE g.mission_key = "
    "f.mission_key AND g.t_ns = f.t_ns AND ifnull(g.seq, -1) > ifnull(f.seq, -1)) AND f.fix_class = ";

/// What a page or a count selects from; the parameters appear in the order in which bind_filter() binds them.
struct Selection {
  std::string from, where;
  int n{0};              ///< parameters so far
  bool in_spans{false};  ///< from k_spans_of_class: in the order of the spans the rows are in that of time

  void bare(const std::string& text) { where += (where.empty() ? " WHERE " : " AND ") + text; }
  void term(const std::string& text) { bare(text + "?" + std::to_string(++n)); }
  std::string last() const { return "?" + std::to_string(n); }
  void since(const char* relation) {
    term(std::string("t_ns ") + relation + " ");
    if (in_spans) bare("from_ns > CAST(" + last() + " AS BIGINT) - 2000000001");
  }
  void until(const char* relation) {
    term(std::string("t_ns ") + relation + " ");
    if (in_spans) bare(std::string("from_ns ") + relation + " " + last());
  }
  /// Of a radio: also within the times at which it was heard, so that one hardly heard is found by the index.
  void heard(const char* column, bool of_mission) {
    term(std::string(column) + " = ");
    const std::string known = " FROM device_seen d WHERE " +
                              std::string(of_mission ? "d.mission_key = ?1 AND " : "") +
                              "d.network_id = " + last() + ")";
    bare("t_ns >= (SELECT min(d.first_t_ns)" + known);
    bare("t_ns <= (SELECT max(d.last_t_ns)" + known);
  }
};

template <class Row>
Selection select(const MeasurementStore::Filter& filter) {
  Selection out;
  out.from = " FROM " + std::string(Table<Row>::name);
  if constexpr (std::is_same_v<Row, Range>)
    out.in_spans = filter.mission && filter.fix && *filter.fix != FixClass::none;
  if (filter.mission)
    out.term("mission_key = ");
  else
    out.bare("mission_key NOT IN (SELECT mission_key FROM mission_bin)");
  if (filter.since) out.since(">=");
  if (filter.until) out.until("<");
  if constexpr (std::is_same_v<Row, Range>) {
    if (filter.anchor) out.heard("anchor", filter.mission.has_value());
    if (filter.tag) out.heard("tag", filter.mission.has_value());
    limit_terms(
        filter.limits, k_range_limits, [&](const std::string& text) { out.term(text); },
        [&](const std::string& text) { out.bare(text); });
    if (out.in_spans) {
      out.from =
          " FROM " + (k_spans_of_class + ("?" + std::to_string(++out.n))) + ") span CROSS JOIN uwb_range";
      out.bare("t_ns >= from_ns AND t_ns < until_ns");
    } else if (filter.fix) {
      out.term(k_fix_class);
    }
    if (filter.every > 1) out.term(thinned("range_id"));
  }
  return out;
}

template <class Row>
void bind_filter(Query& query, const MeasurementStore::Filter& filter,
                 const std::optional<std::int64_t>& mission_key) {
  if (mission_key) query << *mission_key;
  if (filter.since) query << *filter.since;
  if (filter.until) query << *filter.until;
  if constexpr (std::is_same_v<Row, Range>) {
    if (filter.anchor) query << *filter.anchor;
    if (filter.tag) query << *filter.tag;
    bind_limits(query, filter.limits);
    if (filter.fix) query << static_cast<int>(*filter.fix);
    if (filter.every > 1) query << static_cast<std::int64_t>(filter.every);
  }
}

/// Text of one page: the filter's parameters, then those of the cursor, then the limit.
template <class Row>
std::string page_text(const MeasurementStore::Filter& filter, bool after) {
  Selection all = select<Row>(filter);
  const std::string id(Table<Row>::id);
  if (after) {
    // The first comparison is implied by the second, but an index can follow only the first.
    const std::string beyond = filter.descending ? "<" : ">";
    if (filter.descending)
      all.until("<=");
    else
      all.since(">=");
    const std::string same = all.last();
    all.bare("(t_ns " + beyond + " " + same + " OR (t_ns = " + same + " AND " + id + " " + beyond + " ?" +
             std::to_string(++all.n) + "))");
  }
  const std::string direction = filter.descending ? " DESC" : "";
  const std::string spans = all.in_spans ? "from_ns" + direction + ", span_id" + direction + ", " : "";
  return "SELECT " + std::string(Table<Row>::columns) + all.from + all.where + " ORDER BY " + spans + "t_ns" +
         direction + ", " + id + direction + " LIMIT ?" + std::to_string(++all.n);
}

/// Nothing narrows the ranges of a mission, or of all: what the appends counted is the answer.
bool unfiltered(const MeasurementStore::Filter& filter) {
  const auto& limits = filter.limits;
  return !filter.anchor && !filter.tag && !filter.since && !filter.until && !filter.fix && !limits.label &&
         !limits.min_distance_m && !limits.max_distance_m && !limits.min_level_dbm && !limits.max_level_dbm;
}

MissionId mission_id(Connection& connection, std::int64_t key) {
  Query query(connection, k_mission_id);
  query << key;
  if (!query.step()) throw SqlError(Failure::damaged, "a measurement without its mission");
  return query.id<MissionId>();
}

Error gone(const MissionId& id) {
  return make_error(Errc::not_found,
                    "no mission " + to_string(id) + ": it was deleted, or has never existed here");
}

template <class Row>
Result<MeasurementStore::Page<Row>> read_page(Connection& connection, const CirFolder& files,
                                              const MeasurementStore::Filter& filter) {
  BOOST_OUTCOME_TRY(const auto cursor, parse_cursor(filter.after));
  MeasurementStore::Page<Row> page;
  std::optional<std::int64_t> key;
  if (filter.mission) {
    key = mission_key(connection, *filter.mission);
    // Also between two pages: what was deleted meanwhile must not pass for a whole flight.
    if (!key) return gone(*filter.mission);
  }
  Query query(connection, page_text<Row>(filter, cursor.has_value()));
  bind_filter<Row>(query, filter, key);
  if (cursor) query << cursor->t_ns << cursor->id;
  // One more than asked tells whether there is a next page.
  query << row_limit(filter.limit) + 1;
  std::map<std::int64_t, MissionId> missions;
  CirFinder archive(files);
  while (query.step()) {
    if (page.rows.size() == filter.limit) {
      if (filter.limit > 0)
        page.next = std::to_string(page.rows.back().time.ns) + "." + std::to_string(page.ids.back());
      break;
    }
    page.ids.push_back(query.integer());
    const std::int64_t row_key = query.integer();
    auto it = missions.find(row_key);
    if (it == missions.end()) it = missions.emplace(row_key, mission_id(connection, row_key)).first;
    page.rows.push_back(Table<Row>::read(query));
    page.rows.back().mission = it->second;
    if (filter.with_cir) {
      BOOST_OUTCOME_TRYV(load_cir(connection, archive, page.ids.back(), page.rows.back()));
    }
  }
  return page;
}

class SqlMeasurementStore final : public MeasurementStore {
 public:
  SqlMeasurementStore(Gate& gate, const CirFolder& files) : gate_(gate), files_(files) {}

  Result<std::vector<RowOutcome>> append_ranges(std::vector<Range> rows, bool atomic) override {
    return append(gate_, rows, atomic);
  }
  Result<std::vector<RowOutcome>> append_fixes(std::vector<Fix> rows, bool atomic) override {
    return append(gate_, rows, atomic);
  }
  Result<Page<Range>> ranges(const Filter& filter) override {
    return read_value<Page<Range>>(gate_, [&](Connection& c) { return read_page<Range>(c, files_, filter); });
  }
  Result<Page<Fix>> fixes(const Filter& filter) override {
    return read_value<Page<Fix>>(gate_, [&](Connection& c) { return read_page<Fix>(c, files_, filter); });
  }
  Result<Range> range(std::int64_t id) override {
    return read_value<Range>(gate_, [&](Connection& c) -> Result<Range> {
      static const std::string text =
          "SELECT " + std::string(Table<Range>::columns) +
          " FROM uwb_range WHERE range_id = ?1 AND mission_key NOT IN (SELECT mission_key FROM mission_bin)";
      Query query(c, text);
      query << id;
      if (!query.step()) return make_error(Errc::not_found, "no range " + std::to_string(id));
      query.skip();
      const std::int64_t key = query.integer();
      Range row = Table<Range>::read(query);
      row.mission = mission_id(c, key);
      CirFinder archive(files_);
      BOOST_OUTCOME_TRYV(load_cir(c, archive, id, row));
      return row;
    });
  }
  Result<std::uint64_t> count_ranges(const MissionId& mission) override {
    return count(mission, k_measurement_count_ranges);
  }
  Result<std::uint64_t> count_ranges(const Filter& all) override {
    Filter filter = all;
    filter.every = 1;
    return read_value<std::uint64_t>(gate_, [&](Connection& c) -> Result<std::uint64_t> {
      const auto key = filter.mission ? mission_key(c, *filter.mission) : std::nullopt;
      if (filter.mission && !key) return gone(*filter.mission);
      if (unfiltered(filter)) {
        Query query(c, key ? k_measurement_count_ranges : k_count_all_ranges);
        if (key) query << *key;
        return query.step() ? query.as<std::uint64_t>() : 0;
      }
      const Selection selection = select<Range>(filter);
      Query query(c, "SELECT count(*)" + selection.from + selection.where);
      bind_filter<Range>(query, filter, key);
      return query.step() ? query.as<std::uint64_t>() : 0;
    });
  }
  Result<std::uint64_t> count_fixes(const MissionId& mission) override {
    return count(mission, k_measurement_count_fixes);
  }

  Result<std::vector<DeviceSeen>> devices(const std::optional<MissionId>& mission) override {
    return read_value<std::vector<DeviceSeen>>(gate_, [&](Connection& c) -> Result<std::vector<DeviceSeen>> {
      Query query(c, mission ? k_devices_of_mission : k_devices);
      if (mission) query << *mission;
      std::vector<DeviceSeen> found;
      while (query.step()) {
        DeviceSeen device;
        device.network_id = query.network_id();
        device.kind = query.one_of(k_radio_words);
        device.mission = query.id<MissionId>();
        device.first_seen = query.time();
        device.last_seen = query.time();
        device.n_ranges = query.as<std::uint64_t>();
        found.push_back(device);
      }
      return found;
    });
  }

 private:
  Result<std::uint64_t> count(const MissionId& mission, const char* text) {
    return read_value<std::uint64_t>(gate_, [&](Connection& c) -> Result<std::uint64_t> {
      const auto key = mission_key(c, mission);
      if (!key) return std::uint64_t{0};
      Query query(c, text);
      query << *key;
      return query.step() ? query.as<std::uint64_t>() : 0;
    });
  }
  Gate& gate_;
  const CirFolder files_;
};

}  // namespace

std::unique_ptr<MeasurementStore> make_measurement_store(Gate& gate, const CirFolder& files) {
  return std::make_unique<SqlMeasurementStore>(gate, files);
}

}  // namespace anchord::sql
