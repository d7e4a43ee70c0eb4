#include "api/formats/starnet.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace anchord {
namespace {

constexpr const char* k_end = "\r\n";  // it runs on Windows

template <class... T>
std::string text(const char* format, const T&... values) {
  std::array<char, 240> out{};
  std::snprintf(out.data(), out.size(), format, values...);
  return out.data();
}

/// One line of ASCII, as the manual asks for: a character beyond it is a question mark.
std::string plain(std::string_view utf8) {
  std::string out;
  for (const char c : utf8) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0) == 0x80) continue;  // the rest of one
    out += byte >= 0x80 ? '?' : byte < 0x20 || byte == 0x7f || c == '\'' || c == '#' ? ' ' : c;
    if (out.size() == 60) break;
  }
  return out;
}

/// Places that were written as a station already, to 0.1 mm: a tag that ranges to several anchors at once is
/// one station.
class Stations {
 public:
  explicit Stations(std::size_t flight) : prefix_("F" + std::to_string(flight + 1) + "T") {}
  /// Its name; the line that makes it goes to `lines` the first time.
  std::string at(const Eigen::Vector3d& place_m, std::string& lines) {
    std::array<std::int64_t, 3> key{};
    for (int i = 0; i < 3; ++i) key[static_cast<std::size_t>(i)] = std::llround(place_m[i] * 1e4);
    const auto [it, fresh] = names_.try_emplace(key, names_.size() + 1);
    const std::string name = prefix_ + std::to_string(it->second);
    if (fresh)
      lines += text("C %s %.4f %.4f %.4f ! ! !", name.c_str(), place_m.y(), place_m.x(), place_m.z()) + k_end;
    return name;
  }

 private:
  std::string prefix_;
  std::map<std::array<std::int64_t, 3>, std::size_t> names_;
};

/// What came of each range, by anchor and time.
struct Lines {
  std::string stations, distances, residuals;
  std::map<NetworkId, std::size_t> n_used;
};

bool finite(const RangeResidual& r) {
  return r.tag_m.allFinite() && std::isfinite(r.corrected_m) && std::isfinite(r.residual_m) &&
         std::isfinite(r.standardised) && std::isfinite(r.weight) && r.sigma_m > 0;
}

void add_range(NetworkId anchor, const RangeResidual& r, bool has_place, Stations& stations, Lines& out) {
  if (!finite(r)) return;
  const std::string from = stations.at(r.tag_m, out.stations);
  const std::string pair = from + '-' + to_string(anchor);
  if (r.weight > 0 && has_place) {
    out.distances +=
        text("D %s %.4f %.4f", pair.c_str(), r.corrected_m, r.sigma_m / std::sqrt(r.weight)) + k_end;
    ++out.n_used[anchor];
  } else {
    out.distances += text("# D %s %.4f %.4f  %s", pair.c_str(), r.corrected_m, r.sigma_m,
                          has_place ? "rejected" : "no position") +
                     k_end;
  }
  out.residuals += text("# %-24s %10.4f %10.4f %9.4f %8.4f %8.3f %6.3f %10.4f %s", pair.c_str(),
                        r.corrected_m, r.corrected_m - r.residual_m, r.residual_m, r.sigma_m, r.standardised,
                        r.weight, r.distance_m, to_rfc3339(r.time).c_str()) +
                   k_end;
}

std::string head(const Calibration& calibration, const StarnetOptions& options) {
  std::string out = "# " + plain(options.program) + ": ranges of calibration " + to_string(calibration.id) +
                    " of " + to_rfc3339(calibration.created) + k_end;
  if (calibration.origin)
    out += text(
               "# Coordinates: north, east, up in metres about latitude %.9f, longitude %.9f, ellipsoidal "
               "height "
               "%.4f (WGS 84)",
               calibration.origin->lat_deg, calibration.origin->lon_deg, calibration.origin->height_m) +
           k_end;
  else
    out += std::string("# Coordinates: y, x, z in metres of the local frame") + k_end;
  for (const char* line :
       {"# Adjust it as a local 3-D job. F1T1 is the first position of the tag's antenna in flight 1, fixed.",
        "# Distances: range bias of the kit subtracted; standard errors are sigma / sqrt(robust weight).",
        "# Errors of ranges are correlated for seconds: standard errors of an adjustment that takes them as",
        "# independent are smaller than those of the calibration, which are given at each anchor."})
    out += std::string(line) + k_end;
  return out + ".3D" + k_end + ".UNITS Meters" + k_end + ".ORDER NE" + k_end + ".DELTA OFF" + k_end;
}

/// Anchors at their estimate, each after what it claims.
std::string anchors(const Calibration& calibration, const StarnetOptions& options, const Lines& lines) {
  const auto settings = nlohmann::json::parse(calibration.settings.text, nullptr, false);
  const bool flat = settings.is_object() && settings.value("dims", nlohmann::json()) == 2;
  std::string out;
  for (const auto& estimate : calibration.anchors) {
    if (options.anchor && estimate.anchor != *options.anchor) continue;
    const std::string id = to_string(estimate.anchor);
    const auto listed = lines.n_used.find(estimate.anchor);
    out += "# " + id + ": " + std::string(k_verdict_words.word(estimate.verdict)) + ", " +
           std::to_string(listed == lines.n_used.end() ? 0 : listed->second) + " of " +
           std::to_string(estimate.n_used) + " ranges that were used are listed";
    if (!estimate.best) {
      out += std::string(", no position") + k_end;
      continue;
    }
    const Eigen::Vector3d& at = estimate.best->position.m;
    const Eigen::Vector3d sigma = estimate.best->covariance_m2.diagonal().cwiseMax(0.0).cwiseSqrt();
    out += text(", sigma %.4f %.4f %.4f m (north, east, up)", sigma.y(), sigma.x(), sigma.z()) + k_end;
    out += text("C %s %.4f %.4f %.4f * * %c", id.c_str(), at.y(), at.x(), at.z(), flat ? '!' : '*');
    const auto name = options.names.find(estimate.anchor);
    if (name != options.names.end() && !name->second.empty()) out += " '" + plain(name->second);
    out += k_end;
  }
  return out;
}

bool has_observations(const Evidence& evidence) {
  return !evidence.flights.empty() &&
         std::ranges::all_of(evidence.flights, [](const FlightEvidence& f) { return f.observations; });
}

}  // namespace

Result<std::string> starnet_listing(const Calibration& calibration, const Evidence& evidence,
                                    const StarnetOptions& options) {
  if (!has_observations(evidence))
    return make_error(Errc::invalid_argument,
                      "this calibration was made by a version that did not store the positions of the tag "
                      "with its ranges: calibrate its missions again");
  Lines lines;
  for (std::size_t i = 0; i < evidence.flights.size(); ++i) {
    const auto& flight = evidence.flights[i];
    Stations stations(i);
    const std::string title = "# Flight " + std::to_string(i + 1) + ": " + plain(flight.name) + k_end;
    for (auto* part : {&lines.stations, &lines.distances, &lines.residuals}) *part += title;
    for (const auto& [anchor, rows] : flight.residuals) {
      if (options.anchor && anchor != *options.anchor) continue;
      const auto estimate = std::ranges::find(calibration.anchors, anchor, &Estimate::anchor);
      const bool has_place = estimate != calibration.anchors.end() && estimate->best.has_value();
      for (const auto& row : rows) add_range(anchor, row, has_place, stations, lines);
    }
  }
  std::string out = head(calibration, options);
  out += k_end + std::string("# Anchors") + k_end + anchors(calibration, options, lines);
  out += k_end + std::string("# Positions of the tag") + k_end + lines.stations;
  out += k_end + std::string("# Ranges") + k_end + lines.distances;
  out += k_end + std::string("# Residuals of each flight's own solution: observed minus computed") + k_end +
         text("# %-24s %10s %10s %9s %8s %8s %6s %10s %s", "From-To", "observed", "computed", "residual",
              "sigma", "std.res.", "weight", "received", "time") +
         k_end + lines.residuals;
  return out;
}

}  // namespace anchord
