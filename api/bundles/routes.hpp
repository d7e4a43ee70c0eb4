#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "api/kit/audit.hpp"
#include "core/base/ids.hpp"
#include "core/ports/feature_file.hpp"
#include "core/ports/print_pdf.hpp"
#include "core/types/mission.hpp"

namespace anchord {
class BundleStore;
class CalibrationStore;
class Clock;
class Ed25519Key;
class EventStore;
class MeasurementStore;
class MissionStore;
class RevisionStore;
class SiteStore;
}  // namespace anchord

namespace anchord::api {

class Router;

/// What a bundle has of a flight beside its rows, for a person who opens it. Of these its events are
/// imported (bundle_notes.hpp).
struct BundleNote {
  std::string name;  ///< "events.ndjson"
  std::string text;
  std::uint64_t rows{};
};

/// What the routes of flight bundles work with; lives as long as the router.
struct BundleApi {
  BundleStore& bundles;
  EventStore& events;
  MissionStore& missions;
  SiteStore& sites;
  const Clock& clock;
  Audit audit;
  std::string made_by;
  std::filesystem::path spool;  ///< where files are made and uploads wait; made when first used
  /// The mission of the path: 404 where none ever was, 410 for one in the bin.
  std::function<Mission(const Request&)> named;
  /// Events of the flight, and what the audit log has of it where who asks may read that.
  std::function<std::vector<BundleNote>(const Mission&, const Principal&)> notes;
  /// A flight came in: caches, watches and events learn of it.
  std::function<void(const MissionId&, const std::string& text, bool with_revisions)> taken;
  CalibrationStore& calibrations;
  RevisionStore& revisions;
  const Ed25519Key& key;  ///< what hand-over packs are signed with
  /// The server's own answer to a request, for the files of a hand-over pack.
  std::function<Response(Request&)> ask;
  MeasurementStore& measurements;
  MakeFeatureFile feature_file;
  PrintPdf print_pdf;
};

/// GET /api/v1/missions/{id}/bundle, GET /api/v1/sites/{id}/bundle, GET /api/v1/missions/{id}/ranges.gpkg
/// and POST /api/v1/bundles.
void add_bundle_routes(Router& router, BundleApi& api);
/// POST /api/v1/bundles/uploads, GET, PATCH and DELETE of one, and POST .../{id}/import.
void add_upload_routes(Router& router, BundleApi& api);
/// GET /api/v1/missions/{id}/handover and GET /api/v1/signing-key.
void add_handover_routes(Router& router, BundleApi& api);

}  // namespace anchord::api
