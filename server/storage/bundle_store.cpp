#include "core/ports/bundle_store.hpp"

#include <map>
#include <set>
#include <utility>

#include "core/types/mission.hpp"
#include "server/storage/bundle_cells.hpp"
#include "server/storage/bundle_cir.hpp"
#include "server/storage/bundle_writer.hpp"
#include "server/storage/measurement_sums.hpp"
#include "server/storage/site_quota.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

/// The transaction of a bundle stands alone: nothing small waits in its group.
constexpr std::size_t k_weight = 20'000;

constexpr const char* k_mission_state = "SELECT state, name FROM mission WHERE mission_key = ?1";
constexpr const char* k_any_mission = "SELECT mission_key FROM mission WHERE id = ?1";
constexpr const char* k_any_site = "SELECT 1 FROM site WHERE id = ?1";
constexpr const char* k_bundle_insert_cir =
    "INSERT INTO cir (range_id, dt_ps, first_path_idx, preamble_count, re_im) VALUES (?1, ?2, ?3, ?4, ?5)";
constexpr const char* k_bundle_revisions = "SELECT number FROM revision";
constexpr const char* k_frame_named = "SELECT id FROM local_frame WHERE name = ?1";
constexpr const char* k_count_fixes_anew =
    "INSERT INTO mission_fixes (mission_key, n_fixes) SELECT mission_key, count(*) FROM fix WHERE "
    "mission_key = ?1 GROUP BY mission_key";

/// One import, inside one transaction.
class Reader {
 public:
  Reader(Connection& c, const MissionId& mission, BundleSource& source)
      : c_(c), mission_(mission), source_(source) {}

  Result<BundleOutcome> run() {
    {
      Query found(c_, k_any_mission);
      found << mission_;
      if (found.step()) key_ = found.integer();
    }
    fresh_ = !key_.has_value();
    if (!fresh_ && !mission_key(c_, mission_))
      return make_error(Errc::conflict,
                        "mission " + to_string(mission_) +
                            " is in the bin of this server: restore it, or remove it permanently");
    if (!fresh_) {
      BOOST_OUTCOME_TRYV(check_landed());
    }
    BOOST_OUTCOME_TRY(leave_out_calibrations());
    BOOST_OUTCOME_TRY(leave_out_revisions());
    BOOST_OUTCOME_TRY(leave_out_profiles());
    for (const auto& spec : bundle_specs()) {
      BOOST_OUTCOME_TRY(take(spec));
    }
    if (fresh_) {
      Query counted(c_, k_count_fixes_anew);
      counted << key_.value();
      counted.run();
    }
    BOOST_OUTCOME_TRYV(check_quotas());
    return std::move(out_);
  }

  /// Of a site: every server edits these, so none depends on another being new.
  Result<BundleOutcome> run_site(const SiteId& site) {
    of_site_ = site;
    for (const auto& spec : site_bundle_specs()) {
      BOOST_OUTCOME_TRY(take(spec));
    }
    BOOST_OUTCOME_TRYV(check_quotas());
    Query found(c_, k_any_site);
    found << site;
    if (found.step()) return std::move(out_);
    return make_error(Errc::invalid_argument, "the bundle has no row of its site " + to_string(site));
  }

 private:
  /// A flight that records has rows in memory too.
  Result<void> check_landed() {
    Query query(c_, k_mission_state);
    query << key_.value();
    if (query.step() && query.one_of(k_mission_state_words) == MissionState::recording)
      return make_error(Errc::conflict, "mission " + to_string(mission_) +
                                            " is recording on this server: finish it first, then send the "
                                            "bundle again; nothing was imported");
    return boost::outcome_v2::success();
  }

  /// Those made with flights that are not here stay out: their rows would name nobody.
  Result<void> leave_out_calibrations() {
    const BundleSpec& spec = spec_named("calibration_mission");
    BOOST_OUTCOME_TRY(source_.open(spec.table));
    BundleRow row;
    for (;;) {
      BOOST_OUTCOME_TRY(const bool more, source_.next(row));
      if (!more) return boost::outcome_v2::success();
      const Uuid calibration = uuid_of(row[0]);
      const MissionId mission{uuid_of(row[2])};
      if (mission == mission_ || mission_key(c_, mission)) continue;
      if (calibrations_out_.insert(calibration).second)
        out_.left_out.push_back(
            {"calibration " + to_string(calibration), "it was made with mission " + to_string(mission) +
                                                          " too, which is not on this server: import the "
                                                          "bundle of that mission, then this one again"});
    }
  }

  /// What is published here is this server's word. Those of a bundle stand where nothing else was published,
  /// and all they rest on comes along.
  Result<void> leave_out_revisions() {
    std::set<std::int64_t> mine, theirs, named;
    const BundleSpec& revision = spec_named("revision");
    BOOST_OUTCOME_TRY(source_.open(revision.table));
    BundleRow row;
    bool whole = true, others = false;
    for (;;) {
      BOOST_OUTCOME_TRY(const bool more, source_.next(row));
      if (!more) break;
      theirs.insert(whole_of(row[0]));
      if (const auto here = stored(revision, row))
        others = others || !differing(revision, *here, row).empty();
      whole = whole && !calibrations_out_.contains(uuid_of(row[1]));
    }
    BOOST_OUTCOME_TRY(source_.open(spec_named("revision_position").table));
    for (;;) {
      BOOST_OUTCOME_TRY(const bool more, source_.next(row));
      if (!more) break;
      named.insert(whole_of(row[2]));
    }
    for (const std::int64_t number : named) whole = whole && theirs.contains(number);
    Query query(c_, k_bundle_revisions);
    while (query.step()) mine.insert(query.integer());
    for (const std::int64_t number : mine) others = others || !theirs.contains(number);
    revisions_out_ = others || !whole;
    if (!revisions_out_) return boost::outcome_v2::success();
    for (const std::int64_t number : theirs)
      out_.left_out.push_back(
          {"revision " + std::to_string(number),
           others ? "this server has published revisions of its own: publish the calibration here"
                  : "it is based on revisions or calibrations that are not in the bundle: publish the "
                    "calibration here"});
    return boost::outcome_v2::success();
  }

  /// Every server learns the profile of a kit for itself, and numbers its versions from 1. Those of a bundle
  /// go on from what is here, or stay out.
  Result<void> leave_out_profiles() {
    const BundleSpec& spec = spec_named("kit_profile");
    BOOST_OUTCOME_TRY(source_.open(spec.table));
    BundleRow row;
    for (;;) {
      BOOST_OUTCOME_TRY(const bool more, source_.next(row));
      if (!more) return boost::outcome_v2::success();
      const auto here = stored(spec, row);
      if (!here || differing(spec, *here, row).empty() || !profiles_out_.insert(row[0]).second) continue;
      out_.left_out.push_back({name_of(spec, row), "this server has another profile of the kit"});
    }
  }

  Result<void> take(const BundleSpec& spec) {
    BundleOutcome::Table counted{spec.table.name, 0, 0};
    BOOST_OUTCOME_TRY(source_.open(spec.table));
    BundleRow row;
    if (spec.part == BundlePart::counted && !fresh_) sums_.store(c_);
    for (;;) {
      BOOST_OUTCOME_TRY(const bool more, source_.next(row));
      if (!more) break;
      ++counted.n_rows;
      if (of_site_) {
        BOOST_OUTCOME_TRYV(check_site(spec, row));
      }
      if (skipped(spec, row)) continue;
      BOOST_OUTCOME_TRY(const bool added, take_row(spec, row));
      if (added) ++counted.n_added;
    }
    if (spec.part == BundlePart::mission && counted.n_rows != 1)
      return make_error(Errc::invalid_argument,
                        "a bundle must have one mission, this one has " + std::to_string(counted.n_rows));
    if (spec.part == BundlePart::declared && !fresh_) note_more_here(spec, counted.n_rows);
    out_.tables.push_back(std::move(counted));
    return boost::outcome_v2::success();
  }

  /// Of sites that something was added to: a bundle as a whole stays within, or is not taken.
  Result<void> check_quotas() {
    for (const auto& [site, added] : added_)
      if (auto error = beyond_quota_now(c_, site, added)) return *std::move(error);
    return boost::outcome_v2::success();
  }

  void note_added(const BundleSpec& spec, const BundleRow& row) {
    if (spec.part == BundlePart::measured && !fresh_) return note_grown(spec, row);
    const std::string& table = spec.table.name;
    const bool anchor = table == "anchor", mission = table == "mission";
    if (anchor || mission) {
      const BundleCell& site = row[anchor ? 2 : 1];
      if (std::holds_alternative<std::monostate>(site)) return;
      // A flight that comes has measurements.
      auto& added = added_[SiteId{uuid_of(site)}];
      ++added[static_cast<std::size_t>(anchor ? QuotaKind::anchors : QuotaKind::missions)];
      if (mission) ++added[static_cast<std::size_t>(QuotaKind::measurements)];
    } else if (table == "building_floor" || table == "plan_image" || table == "plan_tiles") {
      places_added_.insert(row[0]);
    }
  }

  /// Pictures come with their floor, or not at all: those of a floor that is here are here, or are others.
  bool of_floor_here(const BundleSpec& spec, const BundleRow& row) {
    const std::string& table = spec.table.name;
    if (table == "plan_image_part" || table == "plan_tile") return !places_added_.contains(row[0]);
    if (table != "plan_image" && table != "plan_tiles") return false;
    if (places_added_.contains(row[1])) return false;
    if (!stored(spec, row))
      out_.left_out.push_back({name_of(spec, row), "its floor exists on this server, with its own pictures"});
    return true;
  }

  bool skipped(const BundleSpec& spec, const BundleRow& row) {
    if (of_floor_here(spec, row)) return true;
    if (spec.part == BundlePart::revision) return revisions_out_;
    if (spec.table.name == "kit_profile") return profiles_out_.contains(row[0]);
    if (spec.table.name == "anchor_external_id") return anchors_out_.contains(row[0]);
    return spec.part == BundlePart::calibration && calibrations_out_.contains(uuid_of(row[0]));
  }

  /// Of a site's bundle: whether the row is of that site, by itself or by what the bundle has before it.
  Result<void> check_site(const BundleSpec& spec, const BundleRow& row) {
    const auto cell = [&](std::string_view name) -> const BundleCell* {
      const auto at = std::ranges::find(spec.columns, name, &BundleColumnSql::bundle);
      return at == spec.columns.end() ? nullptr : &row[static_cast<std::size_t>(at - spec.columns.begin())];
    };
    const BundleCell* const site = spec.table.name == "site" ? row.data() : cell("site_id");
    const BundleCell* const building = cell("building_id");
    const BundleCell* const above = building != nullptr ? building : cell("anchor_id");
    bool theirs =
        site != nullptr ? uuid_of(*site) == of_site_->uuid : above == nullptr || named_.contains(*above);
    if (spec.table.name == "building") {  // the bundle's floors come below the one that is here
      const auto here = stored(spec, row);
      theirs = theirs && (!here || uuid_of((*here)[1]) == of_site_->uuid);
    }
    if (!theirs)
      return make_error(Errc::invalid_argument, "the bundle is of site " + to_string(*of_site_) + ", but " +
                                                    name_of(spec, row) + " is of another one");
    if (site != nullptr) named_.insert(row[0]);
    return boost::outcome_v2::success();
  }

  Result<bool> take_row(const BundleSpec& spec, const BundleRow& row) {
    if (spec.part == BundlePart::mission) {
      BOOST_OUTCOME_TRY(check_mission(spec, row));
    }
    // What belongs to a flight that came just now cannot be here yet.
    if (!fresh_ || !is_of_flight(spec.part)) {
      const auto here = stored(spec, row);
      if (spec.part == BundlePart::counted) return counted_here(spec, here, row);
      if (here) {
        if (const auto column = differing(spec, *here, row); !column.empty()) {
          BOOST_OUTCOME_TRY(stays(spec, row, column));
        }
        return false;
      }
      if (spec.part == BundlePart::declared) {
        out_.left_out.push_back({name_of(spec, row), "the flight has none on this server, which stays"});
        return false;
      }
    }
    if (spec.table.name == "local_frame" && frame_named(row[1])) {
      out_.left_out.push_back({name_of(spec, row), "another frame has the name " +
                                                       in_words(row[1], spec.table.columns[1]) +
                                                       " on this server, and stays"});
      return false;
    }
    BOOST_OUTCOME_TRY(add(spec, row));
    note_added(spec, row);
    return true;
  }

  /// Of a radio, after what was measured with it was added: no less than the bundle's rows make.
  Result<bool> counted_here(const BundleSpec& spec, const std::optional<BundleRow>& here,
                            const BundleRow& row) const {
    const auto at = [](const BundleRow& of, std::size_t i) { return whole_of(of[i]); };
    if (here && at(*here, 2) <= at(row, 2) && at(*here, 3) >= at(row, 3) && at(*here, 4) >= at(row, 4))
      return false;
    return make_error(Errc::conflict, "mission " + to_string(mission_) + ": " + name_of(spec, row) +
                                          " does not agree with the measurements; nothing was imported");
  }

  /// Rows that come late for a flight are stored beyond a quota too.
  void note_grown(const BundleSpec& spec, const BundleRow& row) {
    if (!spec.with_cir) return sums_.note(key_.value(), Fix{});
    Range range = identity_of(spec, row, mission_);
    range.kind = static_cast<RangeKind>(whole_of(row[0]));
    sums_.note(key_.value(), range);
  }

  Result<void> check_mission(const BundleSpec& spec, const BundleRow& row) const {
    if (uuid_of(row[0]) != mission_.uuid)
      return make_error(Errc::invalid_argument, "the bundle is of mission " + to_string(mission_) +
                                                    ", but its row is of another one");
    const auto cell = [&](const char* name) -> const BundleCell& {
      const auto at = std::ranges::find(spec.columns, name, &BundleColumnSql::bundle);
      return row[static_cast<std::size_t>(at - spec.columns.begin())];
    };
    if (whole_of(cell("state")) != static_cast<std::int64_t>(MissionState::finished))
      return make_error(Errc::invalid_argument, "the mission of a bundle must be finished, this one is not");
    const auto* sigma_m = std::get_if<double>(&cell("lever_arm_sigma_m"));
    if (sigma_m != nullptr && !is_lever_arm_sigma(*sigma_m))
      return make_error(Errc::invalid_argument,
                        std::string("lever_arm_sigma_m of the mission ") + k_lever_arm_sigma_rule);
    return boost::outcome_v2::success();
  }

  std::optional<BundleRow> stored(const BundleSpec& spec, const BundleRow& row) {
    Query query(c_, spec.find);
    if (spec.of_mission) query << key_.value();
    for (const std::size_t key : spec.keys) {
      const bool none = std::holds_alternative<std::monostate>(row[key]);
      if (none && std::ranges::count(spec.nullable, spec.columns[key].bundle) > 0)
        query << -1;
      else
        bind_cell(query, row[key], spec.table.columns[key].kind);
    }
    if (!query.step()) return std::nullopt;
    BundleRow here = read_row(query, spec.table);
    if (const auto moved = read_moved(query, spec)) {
      // The digest is enough to know that it is the same one; of another it is enough that there is one.
      const auto cir = cir_of(row);
      if (cir && digest_of(*cir) == *moved)
        std::copy(row.end() - k_cir_cells, row.end(), here.end() - k_cir_cells);
      else
        here.back() = std::string();
    }
    return here;
  }

  bool frame_named(const BundleCell& name) {
    Query query(c_, k_frame_named);
    bind_cell(query, name, CellKind::text);
    return query.step();
  }

  /// The first column in which they differ; of a flight all of them; empty: none.
  static std::string differing(const BundleSpec& spec, const BundleRow& here, const BundleRow& row) {
    std::string columns;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string& name = spec.table.columns[i].name;
      // It differs where a client sent the same to both.
      if (same(here[i], row[i]) || (spec.part == BundlePart::measured && name == "received_t_ns")) continue;
      columns += (columns.empty() ? "" : ", ") + name;
      if (spec.part != BundlePart::mission) break;
    }
    return columns;
  }

  /// Sites, plans and anchors are edited on every server, and what was declared of a flight is corrected; no
  /// measurement rests on their words: what is here stays, and the flight comes all the same.
  Result<void> stays(const BundleSpec& spec, const BundleRow& row, const std::string& columns) {
    const std::string what = name_of(spec, row);
    if (spec.part == BundlePart::mission && (names(columns, "frame") || names(columns, "created_t_ns")))
      return make_error(Errc::conflict, what + " exists on this server with other content (" + columns +
                                            "): it is another flight with the same id; nothing was imported");
    if (!is_edited(spec.part))
      return make_error(Errc::conflict, what + " of mission " + to_string(mission_) +
                                            " exists on this server with other content (" + columns +
                                            "); nothing was imported");
    if (spec.table.name == "anchor") anchors_out_.insert(row[0]);
    // One line of it is enough: there may be thousands.
    if (spec.table.name == "procedure_log" && std::exchange(log_differs_, true))
      return boost::outcome_v2::success();
    out_.left_out.push_back(
        {what, "it exists on this server with other content (" + columns + "), which stays"});
    return boost::outcome_v2::success();
  }
  static bool names(const std::string& columns, std::string_view name) {
    return (", " + columns + ",").find(", " + std::string(name) + ",") != std::string::npos;
  }

  Result<void> add(const BundleSpec& spec, const BundleRow& row) {
    Query query(c_, spec.insert);
    if (spec.of_mission) query << key_.value();
    bool with_cir = false;
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (spec.columns[i].column.empty())
        with_cir = !std::holds_alternative<std::monostate>(row[i]);  // the last of them: its samples
      else
        bind_cell(query, row[i], spec.table.columns[i].kind);
    }
    try {
      if (spec.part == BundlePart::mission)
        key_ = query.inserted("mission_key");
      else if (with_cir)
        add_cir(query.inserted("range_id").value(), row);
      else
        query.run();
    } catch (const SqlError& error) {
      if (error.failure() != Failure::constraint) throw;
      return make_error(Errc::conflict, name_of(spec, row) + " cannot be stored on this server (" +
                                            error.what() + "); nothing was imported");
    }
    return boost::outcome_v2::success();
  }

  void add_cir(std::int64_t range, const BundleRow& row) {
    Query query(c_, k_bundle_insert_cir);
    query << range;
    for (std::size_t i = row.size() - k_cir_cells; i < row.size(); ++i)
      bind_cell(query, row[i], i + 1 == row.size() ? CellKind::bytes : CellKind::real);
    query.run();
  }

  void note_more_here(const BundleSpec& spec, std::uint64_t n_rows) {
    Query query(c_, spec.count);
    query << key_.value();
    const std::uint64_t here = query.step() ? query.as<std::uint64_t>() : 0;
    if (here > n_rows)
      out_.left_out.push_back({spec.table.name, "the flight has " + std::to_string(here) +
                                                    " on this server, not " + std::to_string(n_rows) +
                                                    ", which stay"});
  }

  static const BundleSpec& spec_named(std::string_view name) {
    const auto& all = bundle_specs();
    return *std::ranges::find(all, name, [](const BundleSpec& spec) { return spec.table.name; });
  }

  Connection& c_;
  const MissionId mission_;
  BundleSource& source_;
  std::optional<std::int64_t> key_;
  bool fresh_{false}, revisions_out_{false}, log_differs_{false};
  MeasurementSums sums_;  ///< of what was added to a flight that was here
  std::set<Uuid> calibrations_out_;
  std::set<BundleCell> profiles_out_, anchors_out_;  ///< kits by name, anchors by the id of the bundle
  std::set<BundleCell> places_added_;                ///< floors and pictures
  std::map<SiteId, SiteCounts> added_;
  std::optional<SiteId> of_site_;
  std::set<BundleCell> named_;  ///< of a site's bundle: ids of its rows, here before or not
  BundleOutcome out_;
};

class SqlBundleStore final : public BundleStore {
 public:
  SqlBundleStore(Gate& gate, const CirFolder& files) : gate_(gate), files_(files) {
    for (const auto& spec : bundle_specs()) tables_.push_back(spec.table);
    for (const auto& spec : site_bundle_specs()) site_tables_.push_back(spec.table);
  }

  const std::vector<BundleTable>& tables() const override { return tables_; }

  Result<void> write_out(const MissionId& mission, BundleSink& sink) override {
    const auto error = gate_.read([&](Connection& c) -> std::optional<Error> {
      const auto key = mission_key(c, mission);
      if (!key) return absent("mission", mission);
      Query query(c, k_mission_state);
      query << *key;
      if (query.step() && query.one_of(k_mission_state_words) == MissionState::recording)
        return make_error(Errc::conflict,
                          query.text() + " is recording: finish it first, then take its bundle");
      if (auto written = write_flight(c, mission, *key, files_, sink); !written) return written.error();
      return std::nullopt;
    });
    if (error) return *error;
    return boost::outcome_v2::success();
  }

  Result<BundleOutcome> take_in(const MissionId& mission, BundleSource& source) override {
    return write_value<BundleOutcome>(gate_, k_weight, [&](Connection& c) -> Result<BundleOutcome> {
      return Reader(c, mission, source).run();
    });
  }

  const std::vector<BundleTable>& site_tables() const override { return site_tables_; }

  Result<void> write_site(const SiteId& site, BundleSink& sink) override {
    const auto error = gate_.read([&](Connection& c) -> std::optional<Error> {
      if (auto missing = missing_site(c, site)) return missing;
      for (const auto& spec : site_bundle_specs()) {
        if (auto begun = sink.begin(spec.table); !begun) return begun.error();
        Query query(c, spec.select);
        query << site;
        while (query.step()) {
          if (auto written = sink.row(read_row(query, spec.table)); !written) return written.error();
        }
      }
      return std::nullopt;
    });
    if (error) return *error;
    return boost::outcome_v2::success();
  }

  Result<BundleOutcome> take_site(const SiteId& site, BundleSource& source) override {
    return write_value<BundleOutcome>(gate_, k_weight, [&](Connection& c) -> Result<BundleOutcome> {
      return Reader(c, {}, source).run_site(site);
    });
  }

 private:
  Gate& gate_;
  const CirFolder files_;
  std::vector<BundleTable> tables_, site_tables_;
};

}  // namespace

std::unique_ptr<BundleStore> make_bundle_store(Gate& gate, const CirFolder& files) {
  return std::make_unique<SqlBundleStore>(gate, files);
}

}  // namespace anchord::sql
