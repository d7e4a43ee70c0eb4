// What is handed over after a flight: its bundle, what people read, checksums, a signature.
#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "api/bundles/bundle_file.hpp"
#include "api/bundles/routes.hpp"
#include "api/bundles/spool.hpp"
#include "api/formats/handover.hpp"
#include "api/kit/support.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

/// Published anchors of a flight are those round its calibration, wherever a later one moved them: 11 m.
constexpr double k_margin_deg = 1e-4;
constexpr std::size_t k_page = 20;

struct Exported {
  const char* name;
  const char* path;
  bool by_box;  ///< of published anchors
};
constexpr std::array k_exported{Exported{"anchors.geojson", "/api/v1/exports/anchors.geojson", true},
                                Exported{"anchors.gpkg", "/api/v1/exports/anchors.gpkg", true},
                                Exported{"anchors.dxf", "/api/v1/exports/anchors.dxf", true},
                                Exported{"omlox-zones.json", "/omlox/v2/zones/summary", false}};

bool has(const Calibration& calibration, const MissionId& mission) {
  return std::ranges::count(calibration.missions, mission) > 0;
}

/// The newest calibration of the flight that was published, else the newest.
Result<std::optional<Calibration>> calibration_of(BundleApi& s, const MissionId& mission) {
  for (std::uint64_t before = 0;;) {
    BOOST_OUTCOME_TRY(const auto page, s.revisions.revisions(k_page, before));
    if (page.empty()) break;
    for (const auto& revision : page) {
      BOOST_OUTCOME_TRY(auto calibration, s.calibrations.calibration(revision.calibration));
      if (has(calibration, mission)) return std::optional(std::move(calibration));
    }
    before = page.back().number;
  }
  for (std::optional<CalibrationId> after;;) {
    BOOST_OUTCOME_TRY(auto page, s.calibrations.calibrations(k_page, after));
    if (page.empty()) return std::optional<Calibration>{};
    after = page.back().id;
    for (auto& calibration : page)
      if (has(calibration, mission)) return std::optional(std::move(calibration));
  }
}

/// "west,south,east,north" round the anchors; empty where none is on the globe.
std::string box_of(const Calibration& calibration) {
  double west = 181, south = 91, east = -181, north = -91;
  for (const auto& estimate : calibration.anchors) {
    if (!estimate.best || !estimate.best->wgs84) continue;
    west = std::min(west, estimate.best->wgs84->lon_deg);
    east = std::max(east, estimate.best->wgs84->lon_deg);
    south = std::min(south, estimate.best->wgs84->lat_deg);
    north = std::max(north, estimate.best->wgs84->lat_deg);
  }
  if (west > east) return {};
  return to_wire(Ordered(west - k_margin_deg)) + ',' + to_wire(Ordered(south - k_margin_deg)) + ',' +
         to_wire(Ordered(east + k_margin_deg)) + ',' + to_wire(Ordered(north + k_margin_deg));
}

std::string whole_body(Response& response) {
  if (!response.body_stream) return std::move(response.body);
  std::string all;
  for (std::string part; !(part = response.body_stream()).empty();) all += part;
  return all;
}

/// A pack as it grows.
class Pack {
 public:
  Pack(BundleApi& s, const Request& request, ZipWriter& zip) : s_(s), request_(request), zip_(zip) {}

  void add(const std::string& name, std::string text) {
    Sha256 sum;
    sum.add(text);
    sums_.push_back({name, sum.hex()});
    value_or_problem(zip_.add_text(name, std::move(text)));
  }
  void add_file(const std::string& name, const std::filesystem::path& file) {
    sums_.push_back({name, value_or_problem(entry_of(name, file)).sha256_hex});
    value_or_problem(zip_.add_file(name, file, true));
  }
  /// An answer of this server, where it has one; else why it is left out.
  /// The answer, empty where it is left out.
  std::string add_answer(const std::string& name, const std::string& path, const std::string& box = {}) {
    Request asked;
    asked.path = path;
    if (!box.empty()) asked.query["bbox"] = box;
    asked.principal = request_.principal;
    asked.remote = request_.remote;
    Response answer = s_.ask(asked);
    std::string body = whole_body(answer);
    if (answer.status == 200) {
      add(name, body);
      return body;
    }
    const auto problem = nlohmann::json::parse(body, nullptr, false);
    const bool told = problem.is_object() && problem.contains("detail") && problem["detail"].is_string();
    leave_out(name, told && answer.status != 404 ? problem["detail"].get<std::string>()
                                                 : "this server does not provide it");
    return {};
  }
  void leave_out(const std::string& name, const std::string& why) {
    left_out_.push_back({{"name", name}, {"why", why}});
  }
  /// The list of all, its signature, and what a reader needs for both.
  void sign(const Mission& mission, const std::optional<Calibration>& calibration) {
    Ordered names = Ordered::array();
    for (const auto& sum : sums_) names.push_back(sum.name);
    Ordered contents{{"format", "anchord-handover"},
                     {"version", 1},
                     {"mission", {{"id", to_string(mission.id)}, {"name", mission.name}}},
                     {"calibration", calibration ? Ordered(to_string(calibration->id)) : Ordered(nullptr)},
                     {"made_at", to_rfc3339(s_.clock.now())},
                     {"made_by", s_.made_by},
                     {"key_id", s_.key.open_half().id()},
                     {"files", std::move(names)},
                     {"left_out", std::move(left_out_)}};
    add(std::string(k_pack_contents), to_wire(contents, 1) + '\n');
    add(std::string(k_pack_key), s_.key.open_half().pem());
    const std::string sums = pack_sums(sums_);
    value_or_problem(zip_.add_text(std::string(k_pack_signature), s_.key.sign(sums)));
    value_or_problem(zip_.add_text(std::string(k_pack_sums), sums));
  }

 private:
  BundleApi& s_;
  const Request& request_;
  ZipWriter& zip_;
  std::vector<PackSum> sums_;
  Ordered left_out_ = Ordered::array();
};

/// The report as every browser shows it, and as PDF where this machine prints one.
void add_report(BundleApi& s, Pack& pack, const Calibration& calibration, const SpoolFolder& folder) {
  const std::string html =
      pack.add_answer("report.html", "/api/v1/calibrations/" + to_string(calibration.id) + "/report");
  if (html.empty()) return;
  const auto page = folder.path("report.html"), pdf = folder.path("report.pdf");
  std::ofstream(page, std::ios::binary) << html;
  if (const auto printed = s.print_pdf(page, pdf))
    pack.add_file("report.pdf", pdf);
  else
    pack.leave_out("report.pdf", printed.error().message);
}

Response handover(BundleApi& s, const Request& request) {
  check_query(request, {});
  const Mission mission = s.named(request);
  auto folder = value_or_problem(SpoolFolder::make(s.spool));
  const auto bundle = value_or_problem(make_bundle(s, mission, request.principal, *folder));
  const auto calibration = value_or_problem(calibration_of(s, mission.id));
  const std::string box = calibration ? box_of(*calibration) : "";
  const auto file = folder->path("handover.zip");
  auto zip = value_or_problem(ZipWriter::create(file));
  Pack pack(s, request, zip);
  pack.add_file(std::string(k_pack_bundle), bundle.file);
  if (calibration)
    add_report(s, pack, *calibration, *folder);
  else
    pack.leave_out("report.html", "the mission has no calibration: calibrate it first");
  for (const auto& one : k_exported) {
    if (one.by_box && box.empty())
      pack.leave_out(one.name, "no anchor of this mission has a calibrated position on the globe");
    else
      pack.add_answer(one.name, one.path, one.by_box ? box : "");
  }
  pack.sign(mission, calibration);
  value_or_problem(zip.finish());
  s.audit(request, "mission.handover " + to_string(mission.id));
  return file_answer(std::move(folder), file, "application/zip",
                     "handover-" + to_string(mission.id) + ".zip");
}

Response signing_key(BundleApi& s, const Request& request) {
  check_query(request, {"format"});
  const auto& key = s.key.open_half();
  if (negotiate(request, {"json", "pem"}) == "json")
    return json_response(200, {{"algorithm", "Ed25519"}, {"key_id", key.id()}, {"public_key", key.pem()}});
  Response response;
  response.header("Content-Type", "application/x-pem-file");
  response.body = key.pem();
  return response;
}

}  // namespace

void add_handover_routes(Router& router, BundleApi& s) {
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/handover", readers(),
                       [&s](const Request& request) { return handover(s, request); }}));
  router.add({Method::get, "/api/v1/signing-key", readers(),
              [&s](const Request& request) { return signing_key(s, request); }});
}

}  // namespace anchord::api
