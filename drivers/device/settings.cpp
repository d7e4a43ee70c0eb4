#include "drivers/device/settings.hpp"

#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::device {
namespace {

using Ordered = nlohmann::ordered_json;

std::string text_of(const Ordered& object, const char* key) {
  const auto it = object.find(key);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

Ordered object_of(const std::string& text) {
  auto json = Ordered::parse(text.empty() ? "{}" : text, nullptr, false);
  return json.is_object() ? json : Ordered::object();
}

Result<Ordered> parsed(std::string_view text) {
  if (text.size() > 65'536) return make_error(Errc::bad_frame, "longer than 64 KiB");
  auto json = Ordered::parse(text.begin(), text.end(), nullptr, false);
  if (!json.is_object()) return make_error(Errc::bad_frame, "not a JSON object");
  return json;
}

}  // namespace

std::string to_json(const Settings& s) {
  return to_wire(Ordered{{"id", s.id},
                         {"kind", s.kind},
                         {"name", s.name},
                         {"address", s.address},
                         {"options", object_of(s.options_json)}});
}

Result<Settings> parse_settings(std::string_view text) {
  BOOST_OUTCOME_TRY(const auto json, parsed(text));
  Settings out{text_of(json, "id"), text_of(json, "kind"), text_of(json, "name"), text_of(json, "address"),
               "{}"};
  if (const auto it = json.find("options"); it != json.end() && it->is_object())
    out.options_json = to_wire(*it);
  return out;
}

std::string to_json(const Command& c) {
  return to_wire(Ordered{{"id", c.id}, {"name", c.name}, {"arguments", object_of(c.arguments_json)}});
}

Result<Command> parse_command(std::string_view text) {
  BOOST_OUTCOME_TRY(const auto json, parsed(text));
  Command out;
  if (const auto it = json.find("id"); it != json.end() && it->is_number_unsigned())
    out.id = it->get<std::uint64_t>();
  out.name = text_of(json, "name");
  if (const auto it = json.find("arguments"); it != json.end() && it->is_object())
    out.arguments_json = to_wire(*it);
  return out;
}

}  // namespace anchord::device
