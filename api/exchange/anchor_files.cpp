#include "api/exchange/anchor_files.hpp"

#include <array>
#include <set>

#include "api/anchors/anchor_kml.hpp"
#include "api/anchors/anchor_selection.hpp"
#include "api/anchors/routes.hpp"
#include "api/exchange/anchor_drawing.hpp"
#include "api/exchange/anchor_ifc.hpp"
#include "api/exchange/anchor_tables.hpp"
#include "api/exchange/routes.hpp"
#include "api/kit/support.hpp"
#include "core/base/time.hpp"

namespace anchord::api {
namespace {

using Anchors = std::vector<AnchorFeature>;

[[noreturn]] void refuse(std::string detail) { throw_problem(422, "state", std::move(detail)); }

/// "0x6a21, 0x6a22 and 5 more"
std::string some_of(const std::vector<std::string>& ids) {
  constexpr std::size_t k_named = 5;
  std::string out;
  for (std::size_t i = 0; i < ids.size() && i < k_named; ++i) out += (i > 0 ? ", " : "") + ids[i];
  return ids.size() <= k_named ? out : out + " and " + std::to_string(ids.size() - k_named) + " more";
}

/// Refuses where an anchor lacks something, with what to do.
template <class Lacks>
void complete(const Anchors& anchors, const Lacks& lacks, const std::string& what, std::string_view remedy) {
  std::vector<std::string> ids;
  for (const auto& feature : anchors) {
    if (lacks(feature)) ids.push_back(to_string(feature.anchor.network_id));
  }
  if (!ids.empty())
    refuse(some_of(ids) + (ids.size() == 1 ? " has no " : " have no ") + what + ": " + std::string(remedy));
}

FileHeight checked_height(const Anchors& anchors, const Request& request) {
  const auto height = query_word(request, "height", k_file_height_words).value_or(FileHeight::ellipsoidal);
  std::string why = "see projected_reason of the anchor";
  std::set<int> codes;
  for (const auto& feature : anchors) {
    if (feature.projected)
      codes.insert(feature.projected->epsg);
    else if (!feature.projected_reason.empty())
      why = feature.projected_reason;
  }
  complete(
      anchors, [](const auto& f) { return !f.projected; }, "map coordinates", why);
  if (codes.size() > 1)
    refuse("the anchors are in " + std::to_string(codes.size()) +
           " map systems, the first EPSG:" + std::to_string(*codes.begin()) +
           " and EPSG:" + std::to_string(*std::next(codes.begin())) + ": select one site with site=");
  if (height == FileHeight::orthometric)
    complete(
        anchors, [](const auto& f) { return !f.height_orthometric_m; }, "height above the geoid",
        "install a geoid model (geographiclib-get-geoids egm2008-5, or one in the folder of the setting "
        "geoid.dir) and restart the server, or use height=ellipsoidal");
  return height;
}

struct File {
  std::string_view format, type, name;
  bool has_height;    ///< takes height=
  bool says_retired;  ///< else such anchors are left out: who draws or positions by the file would use them
};
constexpr std::array k_files{File{"kml", "application/vnd.google-earth.kml+xml", "anchors.kml", false, true},
                             File{"gpkg", "application/geopackage+sqlite3", "anchors.gpkg", false, true},
                             File{"dxf", "image/vnd.dxf", "anchors.dxf", true, false},
                             File{"ifc", "application/x-step", "anchors.ifc", true, true},
                             File{"pnezd", "text/csv; charset=utf-8", "anchors-pnezd.csv", true, false},
                             File{"pozyx", "application/json", "pozyx.json", false, false}};

std::string bytes_of(ExchangeApi& s, std::string_view format, const Anchors& anchors,
                     const Request& request) {
  if (format == "kml") return anchors_kml(anchors);
  if (format == "gpkg")
    return value_or_problem(
        s.geopackage(anchor_tables(anchors, s.missions, s.measurements), newest_calibration(anchors)));
  if (format == "dxf") return anchors_dxf(anchors, checked_height(anchors, request));
  if (format == "ifc") return anchors_ifc(anchors, checked_height(anchors, request));
  if (format == "pnezd") return anchors_pnezd(anchors, checked_height(anchors, request));
  complete(
      anchors, [](const auto& f) { return !f.local_m; }, "local coordinates",
      "fit a local frame of its site (POST /frames/{id}/fit)");
  return anchors_pozyx(anchors);
}

/// A drawing does not show what is missing. Of a site none of whose anchors is known to be there, nothing is
/// drawn: where others are published that are in no site, they are most likely those.
void refuse_if_anchors_are_in_no_site(ExchangeApi& s, const Request& request) {
  if (!request.query.contains("site")) return;
  Request any = request;
  any.query.erase("site");
  std::uint64_t number = 0;
  std::vector<std::string> ids;
  for (const auto& feature : selected_anchors(s.anchors, any, number))
    if (!feature.anchor.site) ids.push_back(to_string(feature.anchor.network_id));
  if (!ids.empty())
    refuse("no published anchor is of this site, and " + some_of(ids) + (ids.size() == 1 ? " is" : " are") +
           " in no site: PATCH /anchors/{id} with its site");
}

}  // namespace

Response anchor_file(ExchangeApi& s, std::string_view format, const Request& request) {
  const auto file =
      std::find_if(k_files.begin(), k_files.end(), [&](const File& f) { return f.format == format; });
  if (file == k_files.end()) throw_problem(406, "not-acceptable", "there is no file in this format");
  if (file->has_height)
    check_query(request, {"revision", "site", "bbox", "format", "height"});
  else
    check_query(request, {"revision", "site", "bbox", "format"});
  std::uint64_t number = 0;
  auto anchors = selected_anchors(s.anchors, request, number);
  if (!file->says_retired) std::erase_if(anchors, [](const auto& feature) { return feature.anchor.retired; });
  if (anchors.empty()) refuse_if_anchors_are_in_no_site(s, request);
  Response response;
  response.body = bytes_of(s, format, anchors, request);
  response.header("Content-Type", std::string(file->type));
  response.header("Content-Disposition", "attachment; filename=\"" + std::string(file->name) + '"');
  return response;
}

void add_anchor_file_routes(Router& router, ExchangeApi& s) {
  for (const auto& file : k_files) {
    router.add(as_heavy({Method::get, "/api/v1/exports/" + std::string(file.name), readers(),
                         [&s, &file](const Request& request) {
                           check_query(request, {"revision", "site", "bbox", "height"});
                           return anchor_file(s, file.format, request);
                         }}));
  }
}

}  // namespace anchord::api
