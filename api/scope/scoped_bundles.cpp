// Bundles of flights and sites, in and out, for who is bound to sites: a row of another site, or of the whole
// server, neither leaves nor comes in.
#include <algorithm>
#include <cstring>
#include <map>
#include <set>

#include "api/scope/scoped.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/place_store.hpp"

namespace anchord::api {
namespace {

/// What is learned, and what is published, is of the whole server.
constexpr const char* k_of_the_server[] = {
    "kit_profile", "model", "model_artifact", "revision", "revision_position", "revision_override"};
constexpr const char* k_of_calibrations[] = {"calibration_mission", "estimate",      "hypothesis",
                                             "estimate_refused",    "estimate_gate", "calibration_evidence"};

template <class Names>
bool among(const Names& names, const std::string& name) {
  return std::ranges::any_of(names, [&](const char* one) { return name == one; });
}

template <class I>
I id_of(const BundleCell& cell) {
  I id{};
  const auto* bytes = std::get_if<std::string>(&cell);
  if (bytes != nullptr && bytes->size() == id.uuid.bytes.size())
    std::memcpy(id.uuid.bytes.data(), bytes->data(), bytes->size());
  return id;
}

/// The column; nothing where the table has none of this name.
std::optional<std::size_t> column(const BundleTable& table, std::string_view name) {
  const auto at = std::ranges::find(table.columns, name, &BundleColumn::name);
  if (at == table.columns.end()) return std::nullopt;
  return static_cast<std::size_t>(at - table.columns.begin());
}

struct Seen {
  MissionStore &missions, &all_missions;  ///< the first is scoped
  CalibrationStore &calibrations, &all_calibrations;
  PlaceStore &places, &all_places;
};

/// Which rows are theirs; asked in the order of the tables, row by row.
class Rows {
 public:
  explicit Rows(const Seen& seen) : seen_(seen), sites_(current_sites()) {}

  Result<bool> keeps(const BundleTable& table, const BundleRow& row) {
    if (among(k_of_the_server, table.name)) return false;
    if (table.name == "site") return current_sites().holds(id_of<SiteId>(row.at(0)));
    if (table.name == "anchor_external_id") return kept_.contains(row.at(0));
    if (table.name == "calibration") return keep(row, seen_.calibrations.calibration(of(row)));
    if (among(k_of_calibrations, table.name)) return kept_.contains(row.at(0));
    if (const auto site = column(table, "site_id")) {
      const bool theirs = current_sites().holds(id_of<SiteId>(row.at(*site)));
      if (theirs) kept_.insert(row.at(0));
      return theirs;
    }
    return true;
  }

 protected:
  static CalibrationId of(const BundleRow& row) { return id_of<CalibrationId>(row.at(0)); }
  template <class T>
  Result<bool> keep(const BundleRow& row, const Result<T>& found) {
    BOOST_OUTCOME_TRY(const bool there, is_there(found));
    if (there) kept_.insert(row.at(0));
    return there;
  }

  const Seen& seen_;
  const SiteSet sites_;        ///< of who asks: rows may be read by another thread, which writes them
  std::set<BundleCell> kept_;  ///< ids of anchors, plans, buildings, calibrations that are theirs
};

class Sink final : public BundleSink, private Rows {
 public:
  Sink(const Seen& seen, BundleSink& to) : Rows(seen), to_(to) {}
  Result<void> begin(const BundleTable& table) override {
    table_ = &table;
    return to_.begin(table);
  }
  Result<void> row(const BundleRow& row) override {
    const ForSites sites(sites_);
    BOOST_OUTCOME_TRY(const bool theirs, keeps(*table_, row));
    if (!theirs) return boost::outcome_v2::success();
    return to_.row(row);
  }

 private:
  BundleSink& to_;
  const BundleTable* table_{nullptr};
};

/// What comes in names nothing of another site either, also where it says that it is theirs.
class Source final : public BundleSource, private Rows {
 public:
  Source(const Seen& seen, BundleSource& from, const std::vector<BundleTable>& tables)
      : Rows(seen), from_(from), tables_(tables) {}

  Result<void> open(const BundleTable& table) override {
    const ForSites sites(sites_);
    if (!looked_through_) {
      BOOST_OUTCOME_TRYV(look_through());
    }
    table_ = &table;
    return from_.open(table);
  }
  Result<bool> next(BundleRow& row) override {
    const ForSites sites(sites_);
    for (;;) {
      BOOST_OUTCOME_TRY(const bool more, from_.next(row));
      if (!more) return false;
      BOOST_OUTCOME_TRY(const bool theirs, takes(row));
      if (theirs) return true;
      left_.insert(table_->name);
    }
  }
  /// Tables of which rows stayed out.
  const std::set<std::string>& left() const { return left_; }

 private:
  Result<bool> takes(const BundleRow& row) {
    const std::string& name = table_->name;
    if (name == "mission") {
      BOOST_OUTCOME_TRYV(check_flight(row));
    }
    if (name == "calibration" || among(k_of_calibrations, name)) return calibrations_.contains(row.at(0));
    if (name == "exclusion") kept_.insert(row.at(0));
    if (name == "exclusion_row" || name == "exclusion_taken_back") return kept_.contains(row.at(0));
    if (name == "building") return takes_building(row);
    if (name == "building_floor") return takes_floor(row);
    if (name == "plan_image" || name == "plan_tiles") return floors_.contains(row.at(1));
    return keeps(*table_, row);
  }

  /// By the bundle, and where it is here, by the site that it has here: what is missing is added to it.
  Result<void> check_flight(const BundleRow& row) {
    const auto id = id_of<MissionId>(row.at(0));
    BOOST_OUTCOME_TRY(const bool here, is_there(seen_.all_missions.mission(id)));
    BOOST_OUTCOME_TRY(const bool theirs, is_there(seen_.missions.mission(id)));
    if (current_sites().holds(id_of<SiteId>(row.at(1))) && (theirs || !here))
      return boost::outcome_v2::success();
    return make_error(Errc::conflict,
                      "the flight is of another site than those that this token is bound to: nothing of "
                      "it was imported");
  }
  /// One that is here is of the site that it has here.
  Result<bool> takes_building(const BundleRow& row) {
    const auto id = id_of<BuildingId>(row.at(0));
    BOOST_OUTCOME_TRY(const bool here, is_there(seen_.all_places.building(id)));
    BOOST_OUTCOME_TRY(const bool theirs, is_there(seen_.places.building(id)));
    if (here && !theirs) return false;
    return keeps(*table_, row);
  }
  Result<bool> takes_floor(const BundleRow& row) {
    const auto id = id_of<FloorId>(row.at(0));
    BOOST_OUTCOME_TRY(const bool here, is_there(seen_.all_places.floor(id)));
    BOOST_OUTCOME_TRY(const bool theirs, is_there(seen_.places.floor(id)));
    if ((here && !theirs) || !kept_.contains(row.at(1))) return false;
    floors_.insert(row.at(0));
    return true;
  }

  /// Calibrations that rest on their flights alone and are not those of somebody else.
  Result<void> look_through() {
    looked_through_ = true;
    std::set<BundleCell> others;
    BundleRow row;
    for (const auto& table : tables_) {
      if (table.name != "calibration" && table.name != "calibration_mission" && table.name != "mission")
        continue;
      BOOST_OUTCOME_TRYV(from_.open(table));
      for (;;) {
        BOOST_OUTCOME_TRY(const bool more, from_.next(row));
        if (!more) break;
        BOOST_OUTCOME_TRYV(look_at(table, row, others));
      }
    }
    for (const auto& id : others) calibrations_.erase(id);
    return boost::outcome_v2::success();
  }
  Result<void> look_at(const BundleTable& table, const BundleRow& row, std::set<BundleCell>& others) {
    if (table.name == "mission") {
      mission_ = row.at(0);
    } else if (table.name == "calibration") {
      BOOST_OUTCOME_TRY(const bool here, is_there(seen_.all_calibrations.calibration(of(row))));
      BOOST_OUTCOME_TRY(const bool theirs, is_there(seen_.calibrations.calibration(of(row))));
      if (!here || theirs) calibrations_.insert(row.at(0));
    } else if (row.at(2) != mission_) {
      // A flight that is not here at all is named by the store, as for everybody.
      BOOST_OUTCOME_TRY(const bool theirs, is_there(seen_.missions.mission(id_of<MissionId>(row.at(2)))));
      if (!theirs) others.insert(row.at(0));
    }
    return boost::outcome_v2::success();
  }

  BundleSource& from_;
  const std::vector<BundleTable>& tables_;
  const BundleTable* table_{nullptr};
  bool looked_through_{false};
  BundleCell mission_;
  std::set<BundleCell> calibrations_, floors_;
  std::set<std::string> left_;
};

class ScopedBundles final : public BundleStore {
 public:
  ScopedBundles(BundleStore& all, const Seen& seen) : all_(all), seen_(seen) {}

  const std::vector<BundleTable>& tables() const override { return all_.tables(); }
  const std::vector<BundleTable>& site_tables() const override { return all_.site_tables(); }

  Result<void> write_out(const MissionId& mission, BundleSink& sink) override {
    if (current_sites().all()) return all_.write_out(mission, sink);
    BOOST_OUTCOME_TRYV(seen_.missions.mission(mission));
    Sink theirs(seen_, sink);
    return all_.write_out(mission, theirs);
  }
  Result<BundleOutcome> take_in(const MissionId& mission, BundleSource& source) override {
    if (current_sites().all()) return all_.take_in(mission, source);
    Source theirs(seen_, source, tables());
    return with_left_out(all_.take_in(mission, theirs), theirs);
  }
  Result<void> write_site(const SiteId& site, BundleSink& sink) override {
    if (current_sites().all()) return all_.write_site(site, sink);
    if (!current_sites().holds(site)) return absent("site", site);
    Sink theirs(seen_, sink);
    return all_.write_site(site, theirs);
  }
  Result<BundleOutcome> take_site(const SiteId& site, BundleSource& source) override {
    if (current_sites().all()) return all_.take_site(site, source);
    if (!current_sites().holds(site))
      return make_error(Errc::conflict,
                        "the bundle is of another site than those that this token is bound to: nothing was "
                        "imported");
    Source theirs(seen_, source, site_tables());
    return with_left_out(all_.take_site(site, theirs), theirs);
  }

 private:
  static Result<BundleOutcome> with_left_out(Result<BundleOutcome> outcome, const Source& source) {
    if (!outcome) return outcome;
    for (const auto& table : source.left())
      outcome.value().left_out.push_back(
          {"rows of " + table,
           "they are of the whole server or of another site, and this token is bound to sites"});
    return outcome;
  }

  BundleStore& all_;
  const Seen seen_;
};

}  // namespace

std::unique_ptr<BundleStore> scoped_bundles(const Stores& all, MissionStore& missions,
                                            CalibrationStore& calibrations, PlaceStore& places) {
  return std::make_unique<ScopedBundles>(
      all.bundles, Seen{missions, all.missions, calibrations, all.calibrations, places, all.places});
}

}  // namespace anchord::api
