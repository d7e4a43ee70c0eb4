#include "api/admin/docs_page.hpp"
#include "api/formats/report.hpp"
#include "core/base/to_wire.hpp"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

std::string text_of(const Ordered& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? html_text(at->get<std::string>()) : std::string{};
}

std::string last_part(std::string_view reference) {
  return std::string(reference.substr(reference.rfind('/') + 1));
}

/// A schema in a few words: a link to its section, or its type with what it may hold.
std::string type_of(const Ordered& schema) {
  if (!schema.is_object()) return {};
  if (const auto ref = schema.find("$ref"); ref != schema.end()) {
    const std::string name = html_text(last_part(ref->get<std::string>()));
    return "<a href=\"#schema-" + name + "\">" + name + "</a>";
  }
  for (const char* several : {"oneOf", "anyOf", "allOf"}) {
    const auto list = schema.find(several);
    if (list == schema.end()) continue;
    std::string out;
    for (const auto& one : *list) out += (out.empty() ? "" : " or ") + type_of(one);
    return out;
  }
  std::string out;
  if (const auto type = schema.find("type"); type != schema.end())
    out = html_text(type->is_string() ? type->get<std::string>() : to_wire(*type));
  if (const auto items = schema.find("items"); items != schema.end()) out += " of " + type_of(*items);
  if (const auto words = schema.find("enum"); words != schema.end()) out += " " + html_text(to_wire(*words));
  if (const auto value = schema.find("const"); value != schema.end()) out += " " + html_text(to_wire(*value));
  for (const char* limit : {"format", "minimum", "maximum", "minItems", "maxItems", "maxLength", "default"}) {
    const auto at = schema.find(limit);
    if (at != schema.end())
      out += std::string(", ") + limit + " " +
             html_text(at->is_string() ? at->get<std::string>() : to_wire(*at));
  }
  return out;
}

std::string fields_of(const Ordered& schema) {
  const auto properties = schema.find("properties");
  if (properties == schema.end()) return {};
  const Ordered required = schema.value("required", Ordered::array());
  std::string out = "<table><tr><th>field</th><th>type</th><th>meaning</th></tr>\n";
  for (const auto& [name, field] : properties->items()) {
    const bool must = std::find(required.begin(), required.end(), name) != required.end();
    out += "<tr><td><code>" + html_text(name) + "</code>" + (must ? " *" : "") + "</td><td>" +
           type_of(field) + "</td><td>" + text_of(field, "description") + "</td></tr>\n";
  }
  return out + "</table>\n";
}

std::string contents(const Ordered& content) {
  std::string out;
  for (const auto& [media, body] : content.items()) {
    const auto schema = body.find("schema");
    out += "<code>" + html_text(media) + "</code> " + (schema != body.end() ? type_of(*schema) : "") + "<br>";
    if (schema != body.end() && !schema->contains("$ref")) out += fields_of(*schema);
  }
  return out;
}

std::string parameters_of(const Ordered& list, const Ordered& document) {
  std::string out;
  for (const auto& given : list) {
    const Ordered* one = &given;
    if (const auto ref = given.find("$ref"); ref != given.end())
      one = &document.at(nlohmann::ordered_json::json_pointer(ref->get<std::string>().substr(1)));
    out += "<tr><td><code>" + text_of(*one, "name") + "</code></td><td>" + text_of(*one, "in") + "</td><td>" +
           type_of(one->value("schema", Ordered::object())) + "</td><td>" + text_of(*one, "description") +
           "</td></tr>\n";
  }
  if (out.empty()) return out;
  return "<table><tr><th>parameter</th><th>in</th><th>type</th><th>meaning</th></tr>\n" + out + "</table>\n";
}

std::string operation_of(const std::string& method, const std::string& path, const Ordered& operation,
                         const Ordered& shared, const Ordered& document) {
  std::string name = method;
  for (char& c : name) c = static_cast<char>(c >= 'a' && c <= 'z' ? c - 32 : c);
  std::string out = "<h3 id=\"" + text_of(operation, "operationId") + "\"><code>" + name + " " +
                    html_text(path) + "</code></h3>\n<p>" + text_of(operation, "summary") + "</p>\n";
  if (const auto more = text_of(operation, "description"); !more.empty()) out += "<p>" + more + "</p>\n";
  if (const auto roles = operation.find("x-roles"); roles != operation.end())
    out += "<p>Roles: " + html_text(to_wire(*roles)) + "</p>\n";
  Ordered parameters = shared;
  for (const auto& one : operation.value("parameters", Ordered::array())) parameters.push_back(one);
  out += parameters_of(parameters, document);
  if (const auto body = operation.find("requestBody"); body != operation.end())
    out += "<p>Body: " + contents(body->value("content", Ordered::object())) + "</p>\n";
  out += "<ul>\n";
  const Ordered responses = operation.value("responses", Ordered::object());  // items() refers to it
  for (const auto& [status, answer] : responses.items()) {
    out += "<li><b>" + html_text(status) + "</b> ";
    if (const auto ref = answer.find("$ref"); ref != answer.end())
      out += html_text(last_part(ref->get<std::string>()));
    else
      out += text_of(answer, "description") + " " + contents(answer.value("content", Ordered::object()));
    out += "</li>\n";
  }
  return out + "</ul>\n";
}

constexpr const char* k_style =
    ":root{color-scheme:light dark}body{margin:0;font:16px/1.5 system-ui,sans-serif}"
    "main{max-width:72rem;margin:0 auto;padding:1rem;overflow-wrap:anywhere}"
    "a{display:inline-block;padding:3px 4px}nav ul{display:flex;flex-wrap:wrap;gap:4px 12px;"
    "list-style:none;padding:0}table{border-collapse:collapse;margin:.5rem 0}"
    "td,th{border:1px solid #8888;padding:2px 8px;text-align:left;vertical-align:top}"
    "th,td:nth-child(2):nth-last-child(3){overflow-wrap:normal}"
    "h3{margin-top:2rem;padding-top:.5rem;border-top:1px solid #8888}";

}  // namespace

std::string docs_page(std::string_view openapi_json) {
  const Ordered document = Ordered::parse(openapi_json);
  const Ordered& info = document.at("info");
  std::map<std::string, std::string> sections;  // by tag
  std::vector<std::string> order;
  for (const auto& [path, item] : document.at("paths").items()) {
    const Ordered shared = item.value("parameters", Ordered::array());
    for (const auto& [method, operation] : item.items()) {
      if (method == "parameters") continue;
      const Ordered tags = operation.value("tags", Ordered::array());
      const std::string tag = tags.empty() ? "other" : tags[0].get<std::string>();
      if (!sections.contains(tag)) order.push_back(tag);
      sections[tag] += operation_of(method, path, operation, shared, document);
    }
  }
  std::string out =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>" +
      text_of(info, "title") + "</title><style>" + k_style + "</style></head><body>\n<main>\n<h1>" +
      text_of(info, "title") + " " + text_of(info, "version") + "</h1>\n<p>" + text_of(info, "description") +
      "</p>\n<p>As documents: <a href=\"/api/v1/openapi.json\">openapi.json</a>, <a "
      "href=\"/api/v1/asyncapi.json\">asyncapi.json</a> (live topics). Fields with * are "
      "required.</p>\n<nav aria-label=\"Sections\"><ul>\n";
  for (const auto& tag : order)
    out += "<li><a href=\"#tag-" + html_text(tag) + "\">" + html_text(tag) + "</a></li>\n";
  out += "<li><a href=\"#schemas\">schemas</a></li>\n</ul></nav>\n";
  for (const auto& tag : order)
    out += "<h2 id=\"tag-" + html_text(tag) + "\">" + html_text(tag) + "</h2>\n" + sections[tag];
  out += "<h2 id=\"schemas\">schemas</h2>\n";
  for (const auto& [name, schema] : document.at("components").at("schemas").items()) {
    out += "<h3 id=\"schema-" + html_text(name) + "\">" + html_text(name) + "</h3>\n<p>" +
           text_of(schema, "description") + " " + type_of(schema) + "</p>\n" + fields_of(schema);
  }
  return out + "</main></body></html>\n";
}

}  // namespace anchord::api
