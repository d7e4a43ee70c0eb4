#include "api/exchange/anchor_ifc.hpp"

#define XXH_INLINE_ALL  // no library at run time
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "api/exchange/step_text.hpp"

namespace anchord::api {
namespace {

using step::list;
using step::real;
using step::text;
using step::text_or_null;

constexpr double k_side_m = 0.1;  ///< of the cube that stands for an anchor

/// For what has no id of its own: the same words give the same one.
std::string named_guid(const std::string& words) {
  XXH128_canonical_t hash;
  XXH128_canonicalFromHash(&hash, XXH3_128bits(words.data(), words.size()));
  Uuid id;
  static_assert(sizeof hash.digest == 16);
  std::memcpy(id.bytes.data(), hash.digest, sizeof hash.digest);
  // Version 8 of RFC 9562: one's own.
  id.bytes[6] = static_cast<std::uint8_t>((id.bytes[6] & 0x0f) | 0x80);
  id.bytes[8] = static_cast<std::uint8_t>((id.bytes[8] & 0x3f) | 0x80);
  return step::guid(id);
}

/// Where the coordinates of the file begin in the map system: whole metres, so that no reader rounds.
struct Origin {
  double e_m{}, n_m{};
};

Origin origin_of(std::span<const AnchorFeature> anchors) {
  Origin out;
  for (const auto& feature : anchors) {
    const bool first = &feature == &anchors.front();
    out.e_m = first ? feature.projected->e_m : std::min(out.e_m, feature.projected->e_m);
    out.n_m = first ? feature.projected->n_m : std::min(out.n_m, feature.projected->n_m);
  }
  return {std::floor(out.e_m), std::floor(out.n_m)};
}

/// Of the oldest site, or of the oldest anchor where none has a site (UUIDv7 sort by time): the project of
/// two servers is not the same one, and that of a site stays itself when anchors come to it.
std::string oldest_id(std::span<const AnchorFeature> anchors) {
  std::set<std::string> sites, own;
  for (const auto& feature : anchors) {
    if (feature.anchor.site) sites.insert(to_string(*feature.anchor.site));
    own.insert(to_string(feature.anchor.id));
  }
  const auto& ids = sites.empty() ? own : sites;
  return ids.empty() ? std::string() : *ids.begin();
}

/// Sites, their buildings, and the floors of these, as the anchors name them.
struct Place {
  std::string name;
  std::vector<std::string> inside{};   ///< references of the places in it
  std::vector<std::string> anchors{};  ///< references of those that no place inside has
};

class Model {
 public:
  Model(Origin origin, std::string oldest) : origin_(origin), oldest_(std::move(oldest)) {
    const auto zero = data_.add("IFCCARTESIANPOINT", "(0.,0.,0.)");
    placement_ = data_.add("IFCLOCALPLACEMENT", "$," + data_.add("IFCAXIS2PLACEMENT3D", zero + ",$,$"));
    context_ = data_.add("IFCGEOMETRICREPRESENTATIONCONTEXT",
                         "$,'Model',3,1.E-5," + data_.add("IFCAXIS2PLACEMENT3D", zero + ",$,$") + ",$");
    metre_ = data_.add("IFCSIUNIT", "*,.LENGTHUNIT.,$,.METRE.");
    const auto radian = data_.add("IFCSIUNIT", "*,.PLANEANGLEUNIT.,$,.RADIAN.");
    units_ = data_.add("IFCUNITASSIGNMENT", list({metre_, radian}));
    project_ = data_.add("IFCPROJECT", "'" + named_guid("project\n" + oldest_) +
                                           "',$,'UWB anchors',$,$,$,$," + list({context_}) + "," + units_);
    const auto corner = data_.add("IFCCARTESIANPOINT", "(0.,0.)");
    const auto square =
        data_.add("IFCRECTANGLEPROFILEDEF", ".AREA.,$," + data_.add("IFCAXIS2PLACEMENT2D", corner + ",$") +
                                                "," + real(k_side_m) + "," + real(k_side_m));
    // The cube has the antenna in its middle.
    const auto bottom = data_.add("IFCCARTESIANPOINT", "(0.,0.," + real(-k_side_m / 2) + ")");
    const auto solid = data_.add("IFCEXTRUDEDAREASOLID",
                                 square + "," + data_.add("IFCAXIS2PLACEMENT3D", bottom + ",$,$") + "," +
                                     data_.add("IFCDIRECTION", "(0.,0.,1.)") + "," + real(k_side_m));
    const auto body = data_.add("IFCSHAPEREPRESENTATION", context_ + ",'Body','SweptSolid'," + list({solid}));
    shape_ = data_.add("IFCPRODUCTDEFINITIONSHAPE", "$,$," + list({body}));
  }

  void map_system(const AnchorFeature& feature, FileHeight height) {
    const bool geoid = height == FileHeight::orthometric;
    const auto crs =
        data_.add("IFCPROJECTEDCRS",
                  text("EPSG:" + std::to_string(feature.projected->epsg)) + ",$," +
                      text_or_null(feature.site ? feature.site->crs_frame : std::string()) + "," +
                      text(geoid ? "height above the geoid " + feature.geoid : "ellipsoidal height") +
                      ",$,$," + metre_);
    data_.add("IFCMAPCONVERSION",
              context_ + "," + crs + "," + real(origin_.e_m) + "," + real(origin_.n_m) + ",0.,1.,0.,1.");
  }

  void add(const AnchorFeature& feature, FileHeight height) {
    const auto& anchor = feature.anchor;
    const std::string id = to_string(anchor.network_id);
    const auto at = data_.add("IFCCARTESIANPOINT", "(" + real(feature.projected->e_m - origin_.e_m) + "," +
                                                       real(feature.projected->n_m - origin_.n_m) + "," +
                                                       real(file_height_m(feature, height)) + ")");
    const auto placement =
        data_.add("IFCLOCALPLACEMENT", placement_ + "," + data_.add("IFCAXIS2PLACEMENT3D", at + ",$,$"));
    // A GlobalId is of one thing alone, whatever was typed into two anchors.
    std::string guid = anchor.ifc_guid;
    if (!step::is_guid(guid) || !guids_.insert(guid).second) guid = step::guid(anchor.id.uuid);
    const auto product = data_.add("IFCCOMMUNICATIONSAPPLIANCE",
                                   "'" + guid + "',$," + text(anchor.name.empty() ? id : anchor.name) +
                                       ",$,'UWB anchor'," + placement + "," + shape_ + "," +
                                       text(anchor.asset_tag.empty() ? id : anchor.asset_tag) + ",.ANTENNA.");
    place_of(feature).anchors.push_back(product);
    properties(feature, id, guid, product);
  }

  /// The instances, with every place in the one around it.
  std::string finished() {
    std::vector<std::string> sites;
    for (auto& [site, one] : sites_) {
      for (auto& [name, building] : one.buildings) {
        for (auto& [floor, storey] : building.floors) {
          const std::string words = site + '\n' + name + '\n' + floor;
          building.place.inside.push_back(placed("IFCBUILDINGSTOREY", "floor\n" + words, storey, ",$"));
        }
        one.place.inside.push_back(
            placed("IFCBUILDING", "building\n" + site + '\n' + name, building.place, ",$,$,$"));
      }
      sites.push_back(placed("IFCSITE", "site\n" + site, one.place, ",$,$,$,$,$"));
    }
    aggregate("sites\n" + oldest_, project_, sites);
    return data_.instances();
  }

 private:
  struct Building {
    Place place;
    std::map<std::string, Place> floors;
  };
  struct InSite {
    Place place;
    std::map<std::string, Building> buildings;
  };

  Place& place_of(const AnchorFeature& feature) {
    const auto& anchor = feature.anchor;
    auto& site = sites_[anchor.site ? to_string(*anchor.site) : "none of\n" + oldest_];
    site.place.name = feature.site && !feature.site->name.empty() ? feature.site->name : "Site";
    if (anchor.building.empty() && anchor.floor.empty()) return site.place;
    // A floor is in a building, named or not.
    auto& building = site.buildings[anchor.building];
    building.place.name = anchor.building.empty() ? "Building" : anchor.building;
    if (anchor.floor.empty()) return building.place;
    auto& floor = building.floors[anchor.floor];
    floor.name = anchor.floor;
    return floor;
  }

  void properties(const AnchorFeature& feature, const std::string& id, const std::string& key,
                  const std::string& product) {
    std::vector<std::string> all;
    const auto put = [&](std::string_view name, const std::string& value) {
      all.push_back(data_.add("IFCPROPERTYSINGLEVALUE", text(name) + ",$," + value + ",$"));
    };
    put("NetworkId", "IFCIDENTIFIER(" + text(id) + ")");
    put("Status", "IFCLABEL(" + text(feature.status) + ")");
    if (feature.revision) put("Revision", "IFCINTEGER(" + std::to_string(*feature.revision) + ")");
    if (feature.calibrated) put("CalibratedAt", "IFCDATETIME(" + text(to_rfc3339(*feature.calibrated)) + ")");
    if (const auto accuracy = map_accuracy(feature)) {
      put("HorizontalAccuracy95", "IFCLENGTHMEASURE(" + real(accuracy->h95_m) + ")");
      put("VerticalAccuracy95", "IFCLENGTHMEASURE(" + real(accuracy->v95_m) + ")");
    }
    if (!feature.anchor.space.empty()) put("Space", "IFCLABEL(" + text(feature.anchor.space) + ")");
    const auto set = data_.add(
        "IFCPROPERTYSET", "'" + named_guid("properties\n" + key) + "',$,'anchord_Anchor',$," + list(all));
    data_.add("IFCRELDEFINESBYPROPERTIES",
              "'" + named_guid("has properties\n" + key) + "',$,$,$," + list({product}) + "," + set);
  }

  /// The instance of a place, with what is in it. `more`: its attributes behind CompositionType.
  std::string placed(std::string_view type, const std::string& words, const Place& place,
                     std::string_view more) {
    const auto reference = data_.add(type, "'" + named_guid(words) + "',$," + text(place.name) + ",$,$," +
                                               placement_ + ",$,$,.ELEMENT." + std::string(more));
    aggregate(words, reference, place.inside);
    if (!place.anchors.empty())
      data_.add("IFCRELCONTAINEDINSPATIALSTRUCTURE",
                "'" + named_guid("contains\n" + words) + "',$,$,$," + list(place.anchors) + "," + reference);
    return reference;
  }

  void aggregate(const std::string& words, const std::string& whole, const std::vector<std::string>& parts) {
    if (parts.empty()) return;
    data_.add("IFCRELAGGREGATES",
              "'" + named_guid("parts\n" + words) + "',$,$,$," + whole + "," + list(parts));
  }

  Origin origin_;
  std::string oldest_;  ///< id
  StepData data_;
  std::string placement_, context_, metre_, units_, project_, shape_;
  std::set<std::string> guids_;
  std::map<std::string, InSite> sites_;
};

}  // namespace

std::string anchors_ifc(std::span<const AnchorFeature> anchors, FileHeight height) {
  Model model(origin_of(anchors), oldest_id(anchors));
  if (!anchors.empty()) model.map_system(anchors.front(), height);
  for (const auto& feature : anchors) model.add(feature, height);
  return "ISO-10303-21;\r\nHEADER;\r\nFILE_DESCRIPTION(('ViewDefinition [ReferenceView_V1.2]'),'2;1');\r\n"
         "FILE_NAME('anchors.ifc'," +
         text(to_rfc3339(newest_calibration(anchors)).substr(0, 19)) +
         ",(''),(''),'anchord','anchord','');\r\nFILE_SCHEMA(('IFC4'));\r\nENDSEC;\r\nDATA;\r\n" +
         model.finished() + "ENDSEC;\r\nEND-ISO-10303-21;\r\n";
}

}  // namespace anchord::api
