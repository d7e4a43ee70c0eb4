#include "api/exchange/ogc_documents.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/time.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::string_view k_json = "application/json";
constexpr std::string_view k_openapi = "application/vnd.oai.openapi+json;version=3.0";

Ordered time_or_null(const std::optional<UtcTime>& time) {
  return time ? Ordered(to_rfc3339(*time)) : Ordered(nullptr);
}

Ordered parameter(std::string_view name, std::string_view where, std::string_view description,
                  Ordered schema) {
  return {{"name", name},
          {"in", where},
          {"description", description},
          {"required", where == "path"},
          {"schema", std::move(schema)}};
}

Ordered operation(std::string id, std::string_view summary, std::string_view type, Ordered parameters) {
  Ordered answer{{"description", "The document"}};
  answer["content"][std::string(type)]["schema"] = {{"type", "object"}};
  Ordered fault{{"description", "application/problem+json that says what to do"}};
  Ordered out{{"operationId", std::move(id)}, {"summary", summary}, {"tags", {"features"}}};
  if (!parameters.empty()) out["parameters"] = std::move(parameters);
  out["responses"] = {{"200", std::move(answer)}, {"default", std::move(fault)}};
  return {{"get", std::move(out)}};
}

Ordered reference(std::string_view name) {
  return {{"$ref", "#/components/parameters/" + std::string(name)}};
}

Ordered limit_schema(const OgcCollection& c) {
  return {{"type", "integer"}, {"minimum", 1}, {"maximum", c.max_limit}, {"default", c.usual_limit}};
}

}  // namespace

const OgcCollection* ogc_collection(std::string_view id) {
  const auto it = std::ranges::find(k_ogc_collections, id, &OgcCollection::id);
  return it == k_ogc_collections.end() ? nullptr : &*it;
}

Ordered ogc_link(std::string href, std::string_view rel, std::string_view type, std::string_view title) {
  return {{"href", std::move(href)}, {"rel", rel}, {"type", type}, {"title", title}};
}

Ordered ogc_landing(const std::string& root) {
  return {{"title", "anchord"},
          {"description", "UWB anchors of buildings, located on the globe by flights round them"},
          {"links",
           {ogc_link(root, "self", k_json, "This document"),
            ogc_link(root + "/api", "service-desc", k_openapi, "The API description"),
            ogc_link(root + "/conformance", "conformance", k_json, "Conformance classes of this server"),
            ogc_link(root + "/collections", "data", k_json, "The collections")}}};
}

Ordered ogc_conformance() {
  return {{"conformsTo",
           {"http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core",
            "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/geojson",
            "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/oas30",
            "http://www.opengis.net/spec/ogcapi-features-2/1.0/conf/crs"}}};
}

Ordered ogc_collection_json(const std::string& root, const OgcCollection& collection,
                            const OgcExtent& extent) {
  const std::string self = root + "/collections/" + std::string(collection.id);
  Ordered out{{"id", collection.id},
              {"title", collection.title},
              {"description", collection.description},
              {"itemType", "feature"}};
  Ordered where = Ordered::object();
  if (extent.box) {
    const auto& b = *extent.box;
    Ordered box{b.west, b.south, b.east, b.north};
    if (std::isfinite(b.low_m)) box = {b.west, b.south, b.low_m, b.east, b.north, b.high_m};
    where["spatial"] = {{"bbox", Ordered::array({std::move(box)})},
                        {"crs", (std::isfinite(b.low_m) ? k_storage_crs : k_flat_crs).uri}};
  }
  if (extent.interval)
    where["temporal"] = {{"interval", Ordered::array({Ordered::array({time_or_null(extent.interval->from),
                                                                      time_or_null(extent.interval->to)})})},
                         {"trs", "http://www.opengis.net/def/uom/ISO-8601/0/Gregorian"}};
  if (!where.empty()) out["extent"] = std::move(where);
  out["crs"] = Ordered::array();
  for (const auto& crs : k_ogc_crs)
    if (collection.has_heights || !crs.has_height) out["crs"].push_back(crs.uri);
  const auto& storage = collection.has_heights ? k_storage_crs : k_flat_crs;
  out["storageCrs"] = storage.uri;
  out["links"] = {ogc_link(self, "self", k_json, "This collection"),
                  ogc_link(self + "/items", "items", k_geojson, collection.title)};
  return out;
}

Ordered ogc_openapi(const std::string& root) {
  const Ordered text{{"type", "string"}};
  const Ordered uri{{"type", "string"}, {"format", "uri"}};
  Ordered paths;
  paths["/"] = operation("getLandingPage", "Landing page", k_json, Ordered::array());
  paths["/conformance"] = operation("getConformance", "Conformance classes", k_json, Ordered::array());
  paths["/collections"] = operation("getCollections", "The collections", k_json, Ordered::array());
  std::size_t most = 0;
  for (const auto& c : k_ogc_collections) {
    most = std::max(most, c.max_limit);
    const std::string path = "/collections/" + std::string(c.id), id(c.id);
    paths[path] = operation("describe_" + id, c.title, k_json, Ordered::array());
    paths[path + "/items"] =
        operation("get_" + id, c.description, k_geojson,
                  {parameter("limit", "query", "Largest number of features on a page", limit_schema(c)),
                   reference("bbox"), reference("bbox-crs"), reference("datetime"), reference("crs")});
    paths[path + "/items/{featureId}"] =
        operation("get_one_of_" + id, c.title, k_geojson, {reference("featureId"), reference("crs")});
  }
  Ordered parameters;
  parameters["limit"] = parameter("limit", "query", "Largest number of features on a page",
                                  {{"type", "integer"},
                                   {"minimum", 1},
                                   {"maximum", most},
                                   {"default", k_ogc_collections[0].usual_limit}});
  parameters["bbox"] =
      parameter("bbox", "query", "west,south,east,north, or with heights west,south,low,east,north,high",
                {{"type", "array"}, {"minItems", 4}, {"maxItems", 6}, {"items", {{"type", "number"}}}});
  parameters["bbox"]["style"] = "form";
  parameters["bbox"]["explode"] = false;
  parameters["bbox-crs"] = parameter("bbox-crs", "query", "Coordinate reference system of bbox", uri);
  parameters["datetime"] = parameter("datetime", "query", "RFC 3339 instant, or begin/end; .. is open", text);
  parameters["crs"] =
      parameter("crs", "query", "Coordinate reference system of the coordinates in the answer", uri);
  parameters["featureId"] = parameter("featureId", "path", "Id of a feature", text);
  Ordered schemes;
  schemes["basic"] = {
      {"type", "http"}, {"scheme", "basic"}, {"description", "Any user name; the token as the password"}};
  schemes["bearer"] = {{"type", "http"}, {"scheme", "bearer"}};
  return {{"openapi", "3.0.3"},
          {"info", {{"title", "anchord: OGC API Features"}, {"version", "1.0.0"}}},
          {"servers", Ordered::array({{{"url", root}}})},
          {"security", Ordered::array({{{"basic", Ordered::array()}}, {{"bearer", Ordered::array()}}})},
          {"paths", std::move(paths)},
          {"components", {{"parameters", std::move(parameters)}, {"securitySchemes", std::move(schemes)}}}};
}

}  // namespace anchord::api
