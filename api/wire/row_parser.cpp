#include "api/wire/row_parser.hpp"

#include <simdjson.h>

#include <array>
#include <bit>
#include <cstring>
#include <span>

#include "api/wire/row_limits.hpp"
#include "core/base/base64.hpp"

namespace anchord::api {
namespace {

using namespace row_limits;
using simdjson::ondemand::field;
using simdjson::ondemand::object;
using simdjson::ondemand::value;

static_assert(std::endian::native == std::endian::little, "impulse responses are sent little endian");

/// Text up to the next quote: of a key, or of a string with nothing escaped in it.
std::string_view up_to_quote(const char* begin, std::size_t most) {
  const void* end = std::memchr(begin, '"', most);
  return {begin, end == nullptr ? 0 : static_cast<std::size_t>(static_cast<const char*>(end) - begin)};
}

bool take(value& from, const Bounds& bounds, double& out) {
  if (from.get_double().get(out) != simdjson::SUCCESS || !bounds.hold(out)) return false;
  out += 0.0;  // a zero has no sign
  return true;
}
bool take(value& from, const Bounds& bounds, std::optional<double>& out) {
  return take(from, bounds, out.emplace());
}
bool take(value& from, const WholeBounds& bounds, std::int64_t& out) {
  return from.get_int64().get(out) == simdjson::SUCCESS && bounds.hold(out);
}
bool take_time(value& from, UtcTime& out) {
  std::int64_t t_us = 0;
  if (!take(from, k_t_us, t_us)) return false;
  out = UtcTime::from_us(t_us);
  return true;
}
bool take_text(value& from, std::size_t most_bytes, std::string_view& out) {
  const std::string_view token = from.raw_json_token();
  if (token.size() < 2 || token.front() != '"') return false;
  out = up_to_quote(token.data() + 1, token.size() - 1);
  return out.size() <= most_bytes && out.find('\\') == std::string_view::npos &&
         out.find('\x7f') == std::string_view::npos;
}
template <std::size_t N>
bool take(value& from, const Bounds& bounds, std::optional<std::array<double, N>>& out) {
  simdjson::ondemand::array array;
  if (from.get_array().get(array) != simdjson::SUCCESS) return false;
  std::size_t n = 0;
  out.emplace();
  for (auto element : array) {
    value one;
    if (n == N || element.get(one) != simdjson::SUCCESS || !take(one, bounds, (*out)[n])) return false;
    ++n;
  }
  return n == N;
}
template <class T, std::size_t N>
bool take_word(value& from, const EnumTable<T, N>& table, T& out) {
  std::string_view word;
  if (!take_text(from, 40, word)) return false;
  const auto found = table.find(word);
  if (found) out = *found;
  return found.has_value();
}
bool take_network_id(value& from, std::optional<NetworkId>& out) {
  std::string_view text;
  if (!take_text(from, k_network_id_bytes, text)) return false;
  const auto id = parse_network_id(text);
  if (id) out = id.value();
  return id.has_value();
}

/// Calls `take_member(index into names, value)` for each member that is not null; false where that is, or
/// where a name is unknown or there twice.
template <std::size_t N, class TakeMember>
bool members(object from, const std::array<std::string_view, N>& names, TakeMember take_member) {
  std::array<bool, N> seen{};
  std::size_t next = 0;  // rows of one sender have their fields in one order
  for (auto member : from) {
    field one;
    if (std::move(member).get(one) != simdjson::SUCCESS) return false;
    const std::string_view name = up_to_quote(one.key().raw(), 32);
    std::size_t at = next;
    for (std::size_t i = 0; i < N && names[at] != name; ++i) at = at + 1 == N ? 0 : at + 1;
    if (names[at] != name || seen[at]) return false;
    seen[at] = true;
    next = at + 1 == N ? 0 : at + 1;
    value& inner = one.value();
    bool null = false;
    if (inner.is_null().get(null) != simdjson::SUCCESS) return false;
    if (!null && !take_member(at, inner)) return false;
  }
  return true;
}

bool take_object(value& from, object& out) { return from.get_object().get(out) == simdjson::SUCCESS; }

/// Position, uncertainty and attitude: the part that a fix and the pose of a range have in common.
struct PoseFields {
  static constexpr std::size_t k_count = 9;
  std::optional<double> lon_deg, lat_deg, height_m, heading_deg;
  std::optional<std::array<double, 3>> local_m, sigma_m;
  std::optional<std::array<double, 6>> covariance_m2;
  std::optional<std::array<double, 4>> q;
  std::optional<FixClass> fix;

  bool take_member(std::size_t at, value& from) {
    switch (at) {
      case 0:
        return take(from, k_lon_deg, lon_deg);
      case 1:
        return take(from, k_lat_deg, lat_deg);
      case 2:
        return take(from, k_height_m, height_m);
      case 3:
        return take(from, k_local_m, local_m);
      case 4:
        return take_word(from, k_fix_words, fix.emplace());
      case 5:
        return take(from, k_sigma_m, sigma_m);
      case 6:
        return take(from, k_covariance_m2, covariance_m2);
      case 7:
        return take(from, k_quaternion, q);
      case 8:
        return take(from, k_heading_deg, heading_deg);
      default:
        return false;
    }
  }
  bool into(Fix& out) const {
    if (!fix) return false;
    out.fix = *fix;
    if (local_m) {
      if (lon_deg || lat_deg || height_m) return false;
      out.frame = TrackFrame::local;
      out.local_m = {(*local_m)[0], (*local_m)[1], (*local_m)[2]};
    } else {
      if (!lon_deg || !lat_deg || !height_m || null_island(*lon_deg, *lat_deg)) return false;
      out.frame = TrackFrame::wgs84;
      out.position = {*lat_deg, *lon_deg, *height_m};
    }
    if (covariance_m2) {
      out.covariance_m2 = covariance_of(*covariance_m2);
      if (!out.covariance_m2) return false;
    } else if (sigma_m) {
      out.covariance_m2 = covariance_of_sigmas(*sigma_m);
    }
    if (q) {
      out.enu_from_body = rotation_of(*q);
      return out.enu_from_body.has_value();
    }
    if (heading_deg) out.enu_from_body = rotation_of_heading(*heading_deg);
    return true;
  }
};
constexpr std::array<std::string_view, PoseFields::k_count> k_pose_names{
    "lon", "lat", "h_m", "local_m", "fix", "sigma_m", "cov_enu_m2", "q", "heading_deg"};

/// What every row has.
struct CommonFields {
  static constexpr std::size_t k_count = 4;
  std::optional<UtcTime> time, received;
  std::optional<std::uint64_t> seq;
  std::optional<MissionId> mission;

  bool take_member(std::size_t at, value& from) {
    switch (at) {
      case 0:
        return take_time(from, time.emplace());
      case 1:
        return take_time(from, received.emplace());
      case 2: {
        std::int64_t n = 0;
        if (!take(from, k_seq, n)) return false;
        seq = static_cast<std::uint64_t>(n);
        return true;
      }
      case 3: {
        std::string_view text;
        if (!take_text(from, k_uuid_bytes, text)) return false;
        const auto id = parse_uuid(text);
        if (id) mission = MissionId{id.value()};
        return id.has_value();
      }
      default:
        return false;
    }
  }
  template <class Row>
  bool into(Row& out, const std::optional<MissionId>& of_request) const {
    if (!time || (!mission && !of_request)) return false;
    out.time = *time;
    out.received = received;
    out.seq = seq;
    out.mission = mission ? *mission : *of_request;
    return true;
  }
};

bool take_truth(value& from, RangeTruth& out) {
  static constexpr std::array<std::string_view, 3> k_names{"distance_m", "los", "campaign"};
  object inner;
  return take_object(from, inner) && members(inner, k_names, [&](std::size_t at, value& member) {
           std::string_view campaign;
           switch (at) {
             case 0:
               return take(member, k_truth_distance_m, out.distance_m);
             case 1:
               return member.get_bool().get(out.los.emplace()) == simdjson::SUCCESS;
             default:
               return take_text(member, k_campaign_bytes, campaign);
           }
         });
}

bool take_samples(std::string_view coded, std::int64_t taps, std::vector<std::int16_t>& out) {
  out.resize(static_cast<std::size_t>(taps) * 2);
  return decode_base64(coded, std::as_writable_bytes(std::span(out)));
}

bool take_cir(value& from, Cir& out) {
  static constexpr std::array<std::string_view, 5> k_names{"n", "dt_ps", "first_path_idx", "rxpacc", "b64"};
  object inner;
  std::int64_t taps = 0;
  std::string_view coded;
  const bool taken = take_object(from, inner) && members(inner, k_names, [&](std::size_t at, value& member) {
                       switch (at) {
                         case 0:
                           return take(member, k_cir_taps, taps);
                         case 1:
                           return take(member, k_cir_dt_ps, out.dt_ps);
                         case 2:
                           return take(member, k_cir_first_path, out.first_path_idx);
                         case 3:
                           return take(member, k_cir_preamble, out.preamble_count);
                         default:
                           return take_text(member, k_cir_base64_bytes, coded);
                       }
                     });
  return taken && taps > 0 && take_samples(coded, taps, out.re_im);
}

bool take_pose(value& from, PoseFields& out) {
  object inner;
  return take_object(from, inner) && members(inner, k_pose_names, [&](std::size_t at, value& member) {
           return out.take_member(at, member);
         });
}

/// One range, member by member.
struct RangeFields {
  static constexpr std::array<std::string_view, 17> k_names{
      "t_us",      "received_us", "seq",        "mission", "kind",   "tag",
      "antenna",   "anchor",      "distance_m", "rss_dbm", "fp_dbm", "rx_dbm",
      "std_noise", "heading_deg", "truth",      "cir",     "pose"};
  CommonFields common;
  std::optional<NetworkId> tag, anchor;
  std::optional<double> distance_m;
  std::optional<PoseFields> pose;
  RangeRow row;

  bool take_member(std::size_t at, value& from) {
    Range& range = row.range;
    switch (at) {
      case 4:
        return take_word(from, k_range_kind_words, range.kind);
      case 5:
        return take_network_id(from, tag);
      case 6: {
        std::int64_t antenna = 0;
        if (!take(from, k_antenna, antenna)) return false;
        range.antenna = static_cast<std::uint8_t>(antenna);
        return true;
      }
      case 7:
        return take_network_id(from, anchor);
      case 8:
        return take(from, k_distance_m, distance_m);
      case 9:
        return take(from, k_dbm, range.rss_dbm);
      case 10:
        return take(from, k_dbm, range.fp_dbm);
      case 11:
        return take(from, k_dbm, range.rx_dbm);
      case 12:
        return take(from, k_std_noise, range.std_noise);
      case 13:
        return take(from, k_heading_deg, range.heading_deg);
      case 14:
        return take_truth(from, range.truth.emplace());
      case 15:
        return take_cir(from, range.cir.emplace());
      case 16:
        return take_pose(from, pose.emplace());
      default:
        return common.take_member(at, from);
    }
  }
  bool finish(const std::optional<MissionId>& mission) {
    Range& range = row.range;
    if (!tag || !anchor || !distance_m || !common.into(range, mission)) return false;
    if (*tag == *anchor && tag->value != 0) return false;
    range.tag = *tag;
    range.anchor = *anchor;
    range.distance_m = *distance_m;
    if (!pose) return true;
    Fix fix;
    fix.mission = range.mission;
    fix.time = range.time;
    if (!pose->into(fix)) return false;
    row.pose = fix;
    return true;
  }
};

/// One fix, member by member.
struct FixFields {
  static constexpr std::array<std::string_view, 15> k_names{
      "t_us",        "received_us",      "seq",       "mission", "lon",        "lat",
      "h_m",         "local_m",          "fix",       "sigma_m", "cov_enu_m2", "q",
      "heading_deg", "correction_age_s", "satellites"};
  static constexpr std::size_t k_after_pose = CommonFields::k_count + PoseFields::k_count;
  CommonFields common;
  PoseFields pose;
  Fix row;

  bool take_member(std::size_t at, value& from) {
    if (at < CommonFields::k_count) return common.take_member(at, from);
    if (at < k_after_pose) return pose.take_member(at - CommonFields::k_count, from);
    if (at == k_after_pose) return take(from, k_correction_age_s, row.correction_age_s);
    std::int64_t satellites = 0;
    if (!take(from, k_satellites, satellites)) return false;
    row.satellites = static_cast<int>(satellites);
    return true;
  }
  bool finish(const std::optional<MissionId>& mission) { return common.into(row, mission) && pose.into(row); }
};

}  // namespace

struct RowParser::State {
  simdjson::ondemand::parser parser;
  std::vector<char> padded;  // the parser reads whole words, beyond the end of its text

  template <class RowFields>
  bool read(std::string_view text, const std::optional<MissionId>& mission, RowFields& into) {
    const std::size_t with_padding = text.size() + simdjson::SIMDJSON_PADDING;
    if (padded.size() < with_padding) padded.resize(with_padding);
    text.copy(padded.data(), text.size());
    std::memset(padded.data() + text.size(), ' ', simdjson::SIMDJSON_PADDING);
    simdjson::ondemand::document document;
    if (parser.iterate(padded.data(), text.size(), padded.size()).get(document) != simdjson::SUCCESS)
      return false;
    object row;
    if (document.get_object().get(row) != simdjson::SUCCESS) return false;
    if (!members(row, RowFields::k_names,
                 [&](std::size_t at, value& member) { return into.take_member(at, member); }))
      return false;
    const char* behind = nullptr;
    if (document.current_location().get(behind) == simdjson::SUCCESS) return false;  // more than one object
    return into.finish(mission);
  }
};

RowParser::RowParser() : state_(std::make_unique<State>()) {}
RowParser::~RowParser() = default;

std::optional<RangeRow> RowParser::range(std::string_view text, const std::optional<MissionId>& mission) {
  RangeFields fields;
  if (!state_->read(text, mission, fields)) return std::nullopt;
  return std::move(fields.row);
}

std::optional<Fix> RowParser::fix(std::string_view text, const std::optional<MissionId>& mission) {
  FixFields fields;
  if (!state_->read(text, mission, fields)) return std::nullopt;
  return fields.row;
}

}  // namespace anchord::api
