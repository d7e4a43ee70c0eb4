#include "drivers/mapping/mapping.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/text.hpp"

namespace anchord::mapping {
namespace {

using Json = nlohmann::json;

constexpr std::size_t k_most_word = 200, k_most_path = 16, k_most_ids = 1000, k_most_filter = 1000;

struct Unit {
  std::string_view word;
  double factor;
};
constexpr std::array k_lengths{Unit{"m", 1}, Unit{"cm", 0.01}, Unit{"mm", 0.001}, Unit{"ft", 0.3048}};
constexpr std::array k_powers{Unit{"dBm", 1}, Unit{"cdBm", 0.01}};

/// What is wrong with a mapping, all of it.
class Faults {
 public:
  void add(const std::string& where, const std::string& what) {
    text_ += (text_.empty() ? "" : "; ") + std::string("mapping") + where + ": " + what;
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/// RFC 6901, taken apart; nothing: it is none.
std::optional<std::vector<std::string>> pointer_of(std::string_view text) {
  std::vector<std::string> out;
  while (!text.empty()) {
    if (text.front() != '/' || out.size() >= k_most_path) return std::nullopt;
    text.remove_prefix(1);
    std::string token;
    for (; !text.empty() && text.front() != '/'; text.remove_prefix(1)) {
      if (text.front() != '~') {
        token += text.front();
        continue;
      }
      if (text.size() < 2 || (text[1] != '0' && text[1] != '1')) return std::nullopt;
      token += text[1] == '0' ? '~' : '/';
      text.remove_prefix(1);
    }
    out.push_back(std::move(token));
  }
  return out;
}

class Reader {
 public:
  Reader(const Json& root, Faults& faults) : root_(root), faults_(faults) {}

  Mapping read() {
    Mapping out;
    only(root_, "",
         {"topic", "array", "tag", "anchor", "id_format", "id_prefix", "ids", "distance", "time", "rss",
          "first_path", "received_power", "seq"});
    if (const Json* topic = member("topic")) {
      out.topic = word(*topic, "/topic");
      if (const auto wrong = wrong_filter(out.topic); !wrong.empty()) faults_.add("/topic", wrong);
    }
    if (const Json* list = member("array")) {
      if (list->is_string())
        out.list = place(*list, "/array", {});
      else
        faults_.add("/array", "must be a JSON pointer; \"\" means the whole message");
    }
    out.tag = needed_place("tag");
    out.anchor = needed_place("anchor");
    if (const Json* format = member("id_format")) {
      const auto known = k_id_format_words.find(word(*format, "/id_format"));
      if (!known) faults_.add("/id_format", "must be one of " + list_of(k_id_format_words.words()));
      out.id_format = known.value_or(IdFormat::any);
    }
    if (const Json* prefix = member("id_prefix")) out.id_prefix = word(*prefix, "/id_prefix");
    ids(out);
    if (const Json* distance = member("distance"))
      out.distance = quantity(*distance, "/distance", k_lengths, true);
    else
      faults_.add("/distance", R"(is needed, like {"pointer": "/distance", "unit": "mm"})");
    time(out);
    const auto power = [&](const char* name, std::optional<Quantity>& to) {
      if (const Json* value = member(name)) to = quantity(*value, std::string("/") + name, k_powers, false);
    };
    power("rss", out.rss);
    power("first_path", out.first_path);
    power("received_power", out.received_power);
    if (const Json* seq = member("seq")) out.seq = place(*seq, "/seq", {});
    return out;
  }

 private:
  const Json* member(const char* name) const {
    const auto at = root_.find(name);
    return at == root_.end() ? nullptr : &*at;
  }
  void only(const Json& object, const std::string& where, const std::vector<std::string_view>& names) {
    for (const auto& [name, value] : object.items()) {
      if (std::ranges::find(names, name) != names.end()) continue;
      std::string all;
      for (const auto one : names) all += (all.empty() ? "" : ", ") + std::string(one);
      faults_.add(where + '/' + to_utf8(name, k_most_word), "there is no such key; the keys are " + all);
    }
  }
  std::string word(const Json& value, const std::string& where) {
    if (value.is_string() && value.get_ref<const std::string&>().size() <= k_most_word &&
        value.get_ref<const std::string&>().find('\0') == std::string::npos)
      return value.get<std::string>();
    faults_.add(where, "must be a text of at most " + std::to_string(k_most_word) + " bytes");
    return {};
  }

  Place pointer(const std::string& text, const std::string& where) {
    Place out;
    std::string_view rest = text;
    if (rest.starts_with('#')) {
      out.in = Place::In::message;
      rest.remove_prefix(1);
    }
    auto path = pointer_of(rest);
    if (!path)
      faults_.add(
          where,
          '"' + text +
              "\" is not a JSON pointer: write \"/tag/id\" for the element, \"#/tag\" for the whole message");
    else
      out.path = std::move(*path);
    return out;
  }

  /// A pointer as text, or an object with exactly one of pointer, topic_level, value.
  Place place(const Json& value, const std::string& where, std::vector<std::string_view> more) {
    if (value.is_string()) return pointer(word(value, where), where);
    if (!value.is_object()) {
      faults_.add(where, "must be a JSON pointer, or an object with one");
      return {};
    }
    more.insert(more.begin(), {"pointer", "topic_level", "value"});
    only(value, where, more);
    const auto at = value.find("pointer"), level = value.find("topic_level"), fixed = value.find("value");
    const int n = (at != value.end()) + (level != value.end()) + (fixed != value.end());
    if (n != 1) {
      faults_.add(where, "needs one of pointer, topic_level, value");
      return {};
    }
    if (at != value.end()) return pointer(word(*at, where + "/pointer"), where + "/pointer");
    Place out;
    if (level != value.end()) {
      out.in = Place::In::topic;
      if (level->is_number_unsigned() && *level >= 1 && *level <= 64)
        out.level = level->get<std::size_t>();
      else
        faults_.add(where + "/topic_level", "must be 1 (the first) to 64");
      return out;
    }
    out.in = Place::In::fixed;
    out.text = fixed->is_number_unsigned() ? std::to_string(fixed->get<std::uint64_t>())
                                           : word(*fixed, where + "/value");
    return out;
  }
  Place needed_place(const char* name) {
    const std::string where = std::string("/") + name;
    if (const Json* value = member(name)) return place(*value, where, {});
    faults_.add(where, "is needed, like \"" + where + '"');
    return {};
  }

  template <std::size_t N>
  Quantity quantity(const Json& value, const std::string& where, const std::array<Unit, N>& units,
                    bool needed) {
    Quantity out{place(value, where, {"unit", "scale"}), 1};
    const auto unit = value.is_object() ? value.find("unit") : value.end();
    std::string all;
    for (const auto& one : units) all += (all.empty() ? "" : ", ") + std::string(one.word);
    if (!value.is_object() || unit == value.end()) {
      if (needed) faults_.add(where + "/unit", "is needed: one of " + all);
    } else {
      const auto known =
          std::ranges::find(units, std::string_view(word(*unit, where + "/unit")), &Unit::word);
      if (known == units.end())
        faults_.add(where + "/unit", "must be one of " + all);
      else
        out.factor = known->factor;
    }
    out.factor *= scale(value, where);
    return out;
  }
  double scale(const Json& value, const std::string& where) {
    if (!value.is_object() || !value.contains("scale")) return 1;
    const auto& scale = value["scale"];
    if (scale.is_number() && std::isfinite(scale.get<double>()) && scale.get<double>() != 0)
      return scale.get<double>();
    faults_.add(where + "/scale", "must be a number other than 0");
    return 1;
  }

  void ids(Mapping& out) {
    const Json* all = member("ids");
    if (all == nullptr) return;
    if (!all->is_object() || all->size() > k_most_ids)
      return faults_.add("/ids",
                         "must be an object of at most " + std::to_string(k_most_ids) + " words and ids");
    for (const auto& [name, value] : all->items()) {
      const auto id = parse_network_id(value.is_string() ? value.get_ref<const std::string&>() : "");
      if (id)
        out.ids[name] = id.value();
      else
        faults_.add("/ids/" + to_utf8(name, k_most_word), R"(must be an id like "0x6a2f")");
    }
  }

  void time(Mapping& out) {
    const Json* value = member("time");
    if (value == nullptr) return;
    const std::string where = "/time";
    Mapping::Time time;
    time.value.at = place(*value, where, {"unit", "scale", "clock", "wrap_bits"});
    time.value.factor = scale(*value, where);
    const auto text = [&](const char* name) {
      return value->is_object() && value->contains(name) ? word((*value)[name], where + '/' + name)
                                                         : std::string();
    };
    const auto unit = k_time_unit_words.find(text("unit"));
    if (!unit) faults_.add(where + "/unit", "must be one of " + list_of(k_time_unit_words.words()));
    time.unit = unit.value_or(TimeUnit::s);
    const auto clock = text("clock");
    if (!clock.empty() && clock != "utc" && clock != "device")
      faults_.add(where + "/clock", "must be utc (Unix time) or device (since it was switched on)");
    time.of_device = clock == "device";
    if (value->is_object() && value->contains("wrap_bits")) {
      const auto& bits = (*value)["wrap_bits"];
      if (bits.is_number_unsigned() && bits >= 8 && bits <= 48 && time.of_device)
        time.wrap_bits = bits.get<int>();
      else
        faults_.add(where + "/wrap_bits", "must be 8 to 48, of a clock \"device\"");
    }
    if (time.of_device && time.unit == TimeUnit::rfc3339)
      faults_.add(where, "the device's own clock counts up; rfc3339 is Unix time: use clock utc");
    out.time = time;
  }

  const Json& root_;
  Faults& faults_;
};

bool all_hex(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F');
  });
}

}  // namespace

Result<Mapping> parse_mapping(std::string_view json) {
  const auto root = Json::parse(json.begin(), json.end(), nullptr, false);
  if (!root.is_object()) return make_error(Errc::invalid_argument, "mapping: must be a JSON object");
  Faults faults;
  Mapping out = Reader(root, faults).read();
  if (!faults.text().empty()) return make_error(Errc::invalid_argument, faults.text());
  return out;
}

// MQTT 3.1.1 section 4.7.
std::string wrong_filter(std::string_view filter) {
  if (filter.empty() || filter.size() > k_most_filter)
    return "must have 1 to " + std::to_string(k_most_filter) + " bytes";
  if (!is_utf8(filter) || filter.find('\0') != std::string_view::npos) return "must be UTF-8 without NUL";
  for (std::size_t at = 0; at <= filter.size();) {
    const auto end = std::min(filter.find('/', at), filter.size());
    const auto level = filter.substr(at, end - at);
    if (level.find('+') != std::string_view::npos && level != "+") return "'+' must be a whole level";
    if (level.find('#') != std::string_view::npos && (level != "#" || end != filter.size()))
      return "'#' must be the whole last level";
    at = end + 1;
  }
  return {};
}

std::optional<NetworkId> id_of(const Mapping& mapping, std::string_view text) {
  if (const auto known = mapping.ids.find(std::string(text)); known != mapping.ids.end())
    return known->second;
  if (!mapping.id_prefix.empty()) {
    if (!text.starts_with(mapping.id_prefix)) return std::nullopt;
    text.remove_prefix(mapping.id_prefix.size());
  }
  if (mapping.id_format != IdFormat::hex) {
    if (mapping.id_format == IdFormat::decimal && text.starts_with("0x")) return std::nullopt;
    const auto id = parse_network_id(text);
    return id ? std::optional(id.value()) : std::nullopt;
  }
  // Also EUI-64 and addresses with separators; the last 32 bits tell the devices of one system apart.
  std::string digits;
  if (text.starts_with("0x") || text.starts_with("0X")) text.remove_prefix(2);
  for (const char c : text) {
    if (c != ':' && c != '-') digits += c;
  }
  if (!all_hex(digits) || digits.size() > 16) return std::nullopt;
  if (digits.size() > 8) digits.erase(0, digits.size() - 8);
  std::uint32_t value = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  return NetworkId{value};
}

}  // namespace anchord::mapping
