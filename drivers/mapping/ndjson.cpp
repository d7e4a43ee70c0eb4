#include "drivers/mapping/ndjson.hpp"

#include <nlohmann/json.hpp>
#include <utility>

#include "core/base/to_wire.hpp"

namespace anchord::mapping {

void Ndjson::opened(const device::Arrival&) {
  line_.clear();
  first_ = !datagrams_;
  over_ = false;
  device::Identity identity;
  identity.model = "ranges as NDJSON";
  out_.identified(identity);
}

void Ndjson::bytes(std::string_view bytes, const device::Arrival& at) {
  while (!bytes.empty()) {
    const auto end = bytes.find('\n');
    const auto part = bytes.substr(0, end);
    if (over_ || line_.size() + part.size() > Decoder::k_most_bytes) {
      over_ = true;
      line_.clear();
    } else {
      line_ += part;
    }
    if (end == std::string_view::npos) break;
    line(at);
    bytes.remove_prefix(end + 1);
  }
  if (datagrams_) line(at);
}

void Ndjson::line(const device::Arrival& at) {
  const bool first = std::exchange(first_, false);
  const std::string text = std::exchange(line_, {});
  if (std::exchange(over_, false)) return out_.dropped("too_large");
  const auto begin = text.find_first_not_of(" \t\r");
  if (begin == std::string::npos) return;
  // The rest of a line that began before we listened is nobody's fault.
  if (first && text[begin] != '{' && text[begin] != '[') return;
  decoder_.message(text, {}, at);
}

void Ndjson::closed(const device::Arrival&) { decoder_.closed(); }

void Ndjson::command(const device::Command& command, const device::Arrival&) {
  out_.answer(command.id, make_error(Errc::unsupported, "a tag that sends NDJSON does not support commands"));
}

Result<std::unique_ptr<device::Driver>> make_ndjson(std::string_view options_json, bool datagrams,
                                                    device::DriverOutput& output) {
  using Json = nlohmann::json;
  const auto options = Json::parse(options_json.begin(), options_json.end(), nullptr, false);
  for (const auto& [key, value] : options.items()) {
    if (key != "mapping") return make_error(Errc::invalid_argument, key + ": an ndjson device has mapping");
  }
  if (!options.contains("mapping"))
    return make_error(Errc::invalid_argument,
                      "mapping: is needed: an object that gives the place of each value");
  BOOST_OUTCOME_TRY(auto mapping, parse_mapping(to_wire(options["mapping"])));
  if (!mapping.topic.empty())
    return make_error(Errc::invalid_argument, "mapping/topic: lines have no topics: remove it");
  return std::unique_ptr<device::Driver>(std::make_unique<Ndjson>(std::move(mapping), datagrams, output));
}

}  // namespace anchord::mapping
