#include "server/storage/bundle_writer.hpp"

#include <set>

#include "server/storage/bundle_cells.hpp"
#include "server/storage/bundle_cir.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_bundle_writer_sites =
    "SELECT s.id FROM site s WHERE s.id IN (SELECT m.site_id FROM mission m WHERE m.mission_key = ?1) OR "
    "s.id IN (SELECT a.site_id FROM anchor a JOIN device_seen d ON d.network_id = a.network_id WHERE "
    "d.mission_key = ?1 AND d.kind = 1)";
constexpr const char* k_plans = "SELECT id, site_id FROM plan";
constexpr const char* k_bundle_writer_procedure =
    "SELECT state_json FROM mission_procedure WHERE mission_key = ?1";
constexpr const char* k_models = "SELECT id FROM model";
constexpr const char* k_provenance =
    "SELECT c.settings_json, c.provenance_json FROM calibration c JOIN calibration_mission m ON "
    "m.calibration_key = c.calibration_key WHERE m.mission_key = ?1";

/// What else the rows of a flight name, so that it stands whole on another server.
struct Named {
  std::set<Uuid> sites, plans, models;
};

std::string all_text(Connection& c, const char* sql, std::int64_t mission) {
  Query query(c, sql);
  query << mission;
  std::string text;
  while (query.step()) text += query.text() + '\n';
  return text;
}

Named named_by(Connection& c, std::int64_t mission) {
  Named out;
  const std::string flown = all_text(c, k_bundle_writer_procedure, mission);
  std::string told;
  {
    Query query(c, k_provenance);
    query << mission;
    while (query.step()) {
      told += query.text();
      told += query.text();
    }
  }
  {
    Query query(c, k_bundle_writer_sites);
    query << mission;
    while (query.step()) out.sites.insert(query.id<SiteId>().uuid);
  }
  {
    Query query(c, k_plans);
    while (query.step()) {
      const Uuid id = query.id<SiteId>().uuid;
      const auto site = query.maybe([&] { return query.id<SiteId>().uuid; });
      if (flown.find(to_string(id)) == std::string::npos) continue;
      out.plans.insert(id);
      if (site) out.sites.insert(*site);
    }
  }
  Query query(c, k_models);
  while (query.step()) {
    const Uuid id = query.id<ModelId>().uuid;
    if (told.find(to_string(id)) != std::string::npos) out.models.insert(id);
  }
  return out;
}

class Writer {
 public:
  Writer(Connection& c, const MissionId& id, std::int64_t mission, const CirFolder& files, BundleSink& sink)
      : c_(c), id_(id), mission_(mission), named_(named_by(c, mission)), archive_(files), sink_(sink) {}
  std::optional<Error> run() {
    for (const auto& spec : bundle_specs()) {
      if (auto begun = sink_.begin(spec.table); !begun) return begun.error();
      const std::set<Uuid>* each = spec.part == BundlePart::site    ? &named_.sites
                                   : spec.part == BundlePart::plan  ? &named_.plans
                                   : spec.part == BundlePart::model ? &named_.models
                                                                    : nullptr;
      if (each == nullptr) {
        if (auto error = rows(spec, nullptr)) return error;
        continue;
      }
      for (const Uuid& id : *each)
        if (auto error = rows(spec, &id)) return error;
    }
    return std::nullopt;
  }

 private:
  std::optional<Error> rows(const BundleSpec& spec, const Uuid* of) {
    Query query(c_, spec.select);
    if (of == nullptr)
      query << mission_;
    else
      query << SiteId{*of};
    while (query.step()) {
      BundleRow row = read_row(query, spec.table);
      if (const auto moved = read_moved(query, spec)) {
        const auto cir = archive_.find(identity_of(spec, row, id_), *moved);
        if (!cir) return cir.error();
        put_cir(row, cir.value());
      }
      if (auto written = sink_.row(row); !written) return written.error();
    }
    return std::nullopt;
  }

  Connection& c_;
  const MissionId id_;
  const std::int64_t mission_;
  const Named named_;
  CirFinder archive_;
  BundleSink& sink_;
};

}  // namespace

Result<void> write_flight(Connection& connection, const MissionId& id, std::int64_t mission,
                          const CirFolder& files, BundleSink& sink) {
  if (auto error = Writer(connection, id, mission, files, sink).run()) return *std::move(error);
  return boost::outcome_v2::success();
}

}  // namespace anchord::sql
