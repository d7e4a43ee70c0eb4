#include "api/kit/contract_fields.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/contract.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

const Json& document() {
  static const Json parsed = Json::parse(openapi_json());
  return parsed;
}

/// "#/components/schemas/Range" and plain schemas alike.
const Json& resolved(const Json& node) {
  const Json* at = &node;
  while (at->contains("$ref"))
    at = &document().at(Json::json_pointer(at->at("$ref").get<std::string>().substr(1)));
  return *at;
}

void collect(const Json& schema, std::set<std::string>& names) {
  const Json& it = resolved(schema);
  if (const auto own = it.find("properties"); own != it.end()) {
    for (const auto& [name, value] : own->items()) names.insert(name);
  }
  for (const char* parts : {"allOf", "anyOf", "oneOf"}) {
    if (const auto more = it.find(parts); more != it.end()) {
      for (const Json& part : *more) collect(part, names);
    }
  }
}

}  // namespace

std::set<std::string> item_fields(const std::string& path) {
  std::set<std::string> names;
  const Json* at = &document().at("paths");
  for (const std::string& step :
       {path, std::string("get"), std::string("responses"), std::string("200"), std::string("content"),
        std::string("application/json"), std::string("schema"), std::string("properties"),
        std::string("items"), std::string("items")}) {
    at = &resolved(*at);
    const auto next = at->find(step);
    if (next == at->end()) return names;
    at = &*next;
  }
  collect(*at, names);
  return names;
}

}  // namespace anchord::api
