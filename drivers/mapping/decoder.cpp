#include "drivers/mapping/decoder.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/text.hpp"
#include "drivers/time/time_base.hpp"

namespace anchord::mapping {
namespace {

using Json = nlohmann::json;

// As rows that come over REST: reliability.md section 4.
constexpr double k_min_distance_m = 0.05, k_max_distance_m = 150;
constexpr double k_min_dbm = -200, k_max_dbm = 50;
/// A stamp of Unix time further from its arrival is of an old message, or of a clock that nobody set.
constexpr std::int64_t k_most_off_ns = 60'000'000'000;
constexpr std::size_t k_most_tags = 64;
constexpr double k_most_ns = 4e18;  ///< 126 years: sums and differences of two fit

const Json* walk(const Json& from, const std::vector<std::string>& path) {
  const Json* at = &from;
  for (const auto& token : path) {
    if (at->is_object()) {
      const auto found = at->find(token);
      if (found == at->end()) return nullptr;
      at = &*found;
    } else if (at->is_array()) {
      std::size_t index = 0;
      const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), index);
      if (error != std::errc{} || end != token.data() + token.size() || index >= at->size()) return nullptr;
      at = &(*at)[index];
    } else {
      return nullptr;
    }
  }
  return at;
}

std::optional<std::string_view> level_of(std::string_view topic, std::size_t level) {
  for (; level > 1; --level) {
    const auto end = topic.find('/');
    if (end == std::string_view::npos) return std::nullopt;
    topic.remove_prefix(end + 1);
  }
  return topic.substr(0, topic.find('/'));
}

std::optional<double> number_in(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

}  // namespace

bool too_deep(std::string_view json, int most) {
  int depth = 0;
  bool in_string = false, escaped = false;
  for (const char c : json) {
    if (in_string) {
      in_string = escaped || c != '"';
      escaped = !escaped && c == '\\';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      if (++depth > most) return true;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return false;
}

/// One element of one message.
struct Decoder::Values {
  const Json& message;
  const Json& element;
  std::string_view topic;

  const Json* json(const Place& place) const {
    return walk(place.in == Place::In::message ? message : element, place.path);
  }
  /// As text: ids are often numbers.
  std::optional<std::string> text(const Place& place) const {
    if (place.in == Place::In::fixed) return place.text;
    if (place.in == Place::In::topic) {
      const auto level = level_of(topic, place.level);
      return level ? std::optional(std::string(*level)) : std::nullopt;
    }
    const Json* value = json(place);
    if (value == nullptr) return std::nullopt;
    if (value->is_string()) return value->get<std::string>();
    if (value->is_number_unsigned()) return std::to_string(value->get<std::uint64_t>());
    return std::nullopt;
  }
  /// A number, or a text that is one.
  std::optional<double> number(const Place& place) const {
    if (place.in == Place::In::fixed || place.in == Place::In::topic) {
      const auto words = text(place);
      return words ? number_in(*words) : std::nullopt;
    }
    const Json* value = json(place);
    if (value == nullptr) return std::nullopt;
    if (value->is_string()) return number_in(value->get_ref<const std::string&>());
    if (!value->is_number()) return std::nullopt;
    const auto out = value->get<double>();
    return std::isfinite(out) ? std::optional(out) : std::nullopt;
  }
  /// Exactly, where it is a whole number, or a text that is one: a double has no nanoseconds of Unix time.
  std::optional<std::uint64_t> whole(const Place& place) const {
    const Json* value = place.in == Place::In::fixed || place.in == Place::In::topic ? nullptr : json(place);
    if (value != nullptr && value->is_number_unsigned()) return value->get<std::uint64_t>();
    if (value == nullptr || !value->is_string()) return std::nullopt;
    const auto& text = value->get_ref<const std::string&>();
    std::uint64_t out = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    return !text.empty() && error == std::errc{} && end == text.data() + text.size() ? std::optional(out)
                                                                                     : std::nullopt;
  }
};

void Decoder::message(std::string_view text, std::string_view topic, const device::Arrival& at) {
  if (text.size() > k_most_bytes) return out_.dropped("too_large");
  if (!is_utf8(text)) return out_.dropped("not_utf8");
  if (too_deep(text, k_most_depth)) return out_.dropped("too_deep");
  const Json message = Json::parse(text.begin(), text.end(), nullptr, false);
  if (message.is_discarded()) return out_.dropped("not_json");
  const Json* list = nullptr;
  if (mapping_.list) {
    list = walk(message, mapping_.list->path);
    if (list == nullptr || !list->is_array()) return out_.dropped("no_array");
    if (list->size() > k_most_elements) return out_.dropped("too_many", list->size());
  }
  bool any = false;
  if (list == nullptr) {
    any = range({message, message, topic}, at);
  } else {
    for (const auto& element : *list) any = range({message, element, topic}, at) || any;
  }
  if (any) out_.heard();
}

bool Decoder::range(const Values& values, const device::Arrival& at) {
  const auto no = [this](std::string_view reason) {
    out_.dropped(reason);
    return false;
  };
  const auto id = [&](const Place& place) -> std::optional<NetworkId> {
    const auto text = values.text(place);
    return text ? id_of(mapping_, *text) : std::nullopt;
  };
  Range out;
  const auto tag = id(mapping_.tag), anchor = id(mapping_.anchor);
  if (!tag) return no("bad_tag");
  if (!anchor || *anchor == *tag) return no("bad_anchor");
  const auto distance = values.number(mapping_.distance.at);
  if (!distance) return no("bad_distance");
  out.distance_m = *distance * mapping_.distance.factor;
  if (!(out.distance_m >= k_min_distance_m && out.distance_m <= k_max_distance_m)) return no("out_of_reach");
  out.tag = *tag;
  out.anchor = *anchor;
  // A level that is absent or null is not known; one that is there and makes no sense is a mapping that is
  // wrong.
  const auto power = [&](const std::optional<Quantity>& from, std::optional<double>& to) {
    if (!from) return true;
    if (from->at.in == Place::In::element || from->at.in == Place::In::message) {
      const Json* level = values.json(from->at);
      if (level == nullptr || level->is_null()) return true;
    }
    const auto value = values.number(from->at);
    if (!value) return false;
    to = *value * from->factor;
    return *to >= k_min_dbm && *to <= k_max_dbm;
  };
  if (!power(mapping_.rss, out.rss_dbm) || !power(mapping_.first_path, out.fp_dbm) ||
      !power(mapping_.received_power, out.rx_dbm))
    return no("bad_power");
  const auto time = this->time(values, *tag, at);
  if (!time) return false;
  out.time = *time;
  out.received = out_.time().utc_of(at.steady_ns).time;
  out.seq = mapping_.seq ? values.whole(*mapping_.seq) : std::nullopt;
  if (!out.seq) out.seq = seq_++;
  out_.emit(std::move(out));
  return true;
}

std::optional<UtcTime> Decoder::time(const Values& values, NetworkId tag, const device::Arrival& at) {
  const UtcTime arrival = out_.time().utc_of(at.steady_ns).time;
  if (!mapping_.time) return arrival;
  const auto no = [this](std::string_view reason) {
    out_.dropped(reason);
    return std::nullopt;
  };
  const auto& how = *mapping_.time;
  std::int64_t ns = 0;
  const auto counter = values.whole(how.value.at);
  if (how.unit == TimeUnit::rfc3339) {
    const auto text = values.text(how.value.at);
    const auto parsed = text ? parse_rfc3339(*text) : Result<UtcTime>(make_error(Errc::bad_frame, ""));
    if (!parsed) return no("bad_time");
    ns = parsed.value().ns;
  } else {
    const std::int64_t unit_ns = how.unit == TimeUnit::s    ? 1'000'000'000
                                 : how.unit == TimeUnit::ms ? 1'000'000
                                 : how.unit == TimeUnit::us ? 1'000
                                                            : 1;
    const auto number = values.number(how.value.at);
    const double per_count = how.value.factor * static_cast<double>(unit_ns);
    const double real = number ? *number * per_count : -1;
    if (how.of_device) {
      const auto clock = clock_of(tag);
      if (clock == nullptr) return no("too_many_tags");
      double through = real;
      if (how.wrap_bits) {
        if (!counter || *counter >> *how.wrap_bits != 0) return no("bad_time");
        if (!clock->unwrap) clock->unwrap.emplace(*how.wrap_bits);
        through = static_cast<double>((*clock->unwrap)(*counter)) * per_count;
      }
      if (!(through >= 0 && through < k_most_ns)) {
        clocks_.erase(tag);
        return no("bad_time");
      }
      return out_.time().utc_of(steady_of(*clock, tag, static_cast<std::int64_t>(through), at)).time;
    }
    if (!(real >= 0 && real < k_most_ns)) return no("bad_time");
    // A real number of seconds holds a quarter of a microsecond at best.
    ns = counter && how.value.factor == 1 ? static_cast<std::int64_t>(*counter) * unit_ns
                                          : static_cast<std::int64_t>(std::llround(real * 1e-3)) * 1000;
  }
  if (std::abs(ns - arrival.ns) > k_most_off_ns) return no("time_off");
  return UtcTime{ns};
}

Decoder::Clock* Decoder::clock_of(NetworkId tag) {
  if (!clocks_.contains(tag) && clocks_.size() >= k_most_tags) return nullptr;
  return &clocks_[tag];
}

bool Decoder::Pace::add(std::int64_t device_ns, std::int64_t arrival_ns) {
  constexpr std::int64_t k_apart_ns = 50'000'000, k_span_ns = 1'000'000'000;
  constexpr int k_arrivals = 5;
  const auto begin = [&] {
    device_ns_ = device_ns;
    first_ns_ = last_ns_ = arrival_ns;
    arrivals_ = 1;
  };
  if (arrivals_ == 0 || device_ns < device_ns_) begin();
  // What a link held back and brings at once says nothing of the pace.
  if (arrival_ns - last_ns_ >= k_apart_ns) {
    ++arrivals_;
    last_ns_ = arrival_ns;
  }
  const auto passed_ns = arrival_ns - first_ns_;
  if (arrivals_ < k_arrivals || passed_ns < k_span_ns) return keeps_;
  const double pace = static_cast<double>(device_ns - device_ns_) / static_cast<double>(passed_ns);
  keeps_ = pace > 0.1 && pace < 10;
  begin();
  return keeps_;
}

std::int64_t Decoder::steady_of(Clock& clock, NetworkId tag, std::int64_t device_ns,
                                const device::Arrival& at) {
  const bool kept = clock.pace.keeps();
  if (!clock.pace.add(device_ns, at.steady_ns)) {
    if (kept)
      out_.notice(
          "the clock of " + to_string(tag) +
          " does not run at our rate (it stands still, or the unit in the mapping is wrong): its ranges are "
          "stamped on arrival");
    return at.steady_ns;
  }
  if (!kept) {
    clock.model = timing::ClockModel();
    const bool all_run = std::ranges::all_of(clocks_, [](const auto& c) { return c.second.pace.keeps(); });
    if (all_run) out_.notice("");
  }
  auto& model = clock.model;
  const auto stamp = model.stamp(device_ns, at.steady_ns);
  out_.clock({-model.drift() * 1e6, stamp ? stamp->sigma_ns * 1e-9 : 0, model.settled(),
              model.drift_known() && model.drift_too_large()});
  return stamp ? stamp->ns : at.steady_ns;
}

}  // namespace anchord::mapping
