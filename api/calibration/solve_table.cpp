#include "api/calibration/solve_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

namespace anchord {
namespace {

template <class... Args>
void append(std::string& out, const char* format, Args... args) {
  char text[512];
  const int size = std::snprintf(text, sizeof text, format, args...);
  if (size > 0) out.append(text, std::min(static_cast<std::size_t>(size), sizeof text - 1));
}

void append_place(std::string& out, const Hypothesis& h, bool globe) {
  if (globe && h.wgs84) {
    append(out, "%15.9f %15.9f %10.3f", h.wgs84->lat_deg, h.wgs84->lon_deg, h.wgs84->height_m);
  } else {
    append(out, "%15.3f %15.3f %10.3f", h.position.m.x(), h.position.m.y(), h.position.m.z());
  }
}

std::size_t total(const std::map<std::string, std::size_t>& refused) {
  return std::accumulate(refused.begin(), refused.end(), std::size_t{0},
                         [](std::size_t sum, const auto& one) { return sum + one.second; });
}

/// A good place that a gate holds back is not one to read as ok.
std::string verdict_word(const Estimate& e) {
  if (e.verdict == Verdict::ok && !e.acceptable()) return "not acceptable";
  return std::string(k_verdict_words.word(e.verdict));
}

/// Quoted where a comma or quote is inside.
std::string field(std::string_view text) {
  if (text.find_first_of(",\"\n") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

std::string solve_table(std::span<const SolvedFlight> flights) {
  std::string out;
  for (const auto& flight : flights) {
    const FlightSolution& s = *flight.solution;
    const bool globe = flight.data->mission.frame == TrackFrame::wgs84;
    // What there is to read first where the flight gives nothing.
    if (!s.placed) out += "NOT SOLVED: " + s.notes.front() + "\n";
    append(out, "%s  kit %s  %zu ranges, %zu used\n", s.name.c_str(), flight.data->mission.kit.c_str(),
           s.n_ranges, s.n_used);
    append(out,
           "bias %.3f m (sigma %.3f)%s, range curve %.3f m per e-fold (%.3f), lag %.3f s (%.3f), antenna up "
           "%.3f m (%.3f)\n",
           s.shared.bias_m.value, s.shared.bias_m.sigma, s.shared.bias_determined ? "" : " NOT DETERMINED",
           s.shared.curve_m.value, s.shared.curve_m.sigma, s.shared.lag_s.value, s.shared.lag_s.sigma,
           s.shared.lever_up_m.value, s.shared.lever_up_m.sigma);
    append(out, "%-10s %15s %15s %10s %8s %8s %-14s %7s %8s %8s\n", "anchor", globe ? "lat" : "x_m",
           globe ? "lon" : "y_m", globe ? "h_ellips_m" : "z_m", "h95_m", "v95_m", "verdict", "gdop", "used",
           "refused");
    for (const auto& anchor : s.anchors) {
      const Estimate& e = anchor.estimate;
      append(out, "%-10s ", anchor.name.c_str());
      if (e.best) {
        append_place(out, *e.best, globe);
        if (std::isfinite(e.h95_m))
          append(out, " %8.3f %8.3f", e.h95_m, e.v95_m);
        else
          append(out, " %8s %8s", "-", "-");
      } else {
        append(out, "%15s %15s %10s %8s %8s", "-", "-", "-", "-", "-");
      }
      append(out, " %-14s %7.2f %8zu %8zu\n", verdict_word(e).c_str(), e.gdop.value_or(0.0), e.n_used,
             total(e.refused));
      if (e.mirror) {
        append(out, "%-10s ", "  or");
        append_place(out, *e.mirror, globe);
        append(out, " %17s probability %.2f\n", "", e.mirror->probability);
      }
      if (!e.reason.empty()) out += "           " + e.reason + "\n";
      for (const Gate& gate : e.gates) {
        if (gate.passed) continue;
        out += "           gate " + gate.name + " not passed: ";
        if (gate.value) append(out, "%.3g, limit %.3g: ", *gate.value, gate.limit);
        out += gate.why + "\n";
      }
    }
    for (const auto& [why, count] : s.refused) append(out, "refused %-22s %zu\n", why.c_str(), count);
    for (const auto& note : s.notes) out += "note: " + note + "\n";
    out += "\n";
  }
  return out;
}

std::string solve_csv(std::span<const SolvedFlight> flights) {
  std::string out =
      "flight,anchor_id,network_id,verdict,determined,lon,lat,h_m,e_m,n_m,u_m,cov_ee_m2,cov_en_m2,cov_eu_m2,"
      "cov_nn_m2,"
      "cov_nu_m2,cov_uu_m2,h95_m,v95_m,mirror_e_m,mirror_n_m,mirror_u_m,probability,n_ranges,n_refused,gdop,"
      "bias_m,lag_s,reason,acceptable,failed_gates\n";
  for (const auto& flight : flights) {
    for (const auto& anchor : flight.solution->anchors) {
      const Estimate& e = anchor.estimate;
      out += field(flight.solution->name) + "," + field(anchor.name) + "," + to_string(e.anchor) + ",";
      out += std::string(k_verdict_words.word(e.verdict)) + "," +
             std::string(k_determined_words.word(anchor.determined)) + ",";
      if (e.best && e.best->wgs84) {
        append(out, "%.9f,%.9f,%.4f,", e.best->wgs84->lon_deg, e.best->wgs84->lat_deg,
               e.best->wgs84->height_m);
      } else {
        out += ",,,";
      }
      if (e.best) {
        const auto& p = e.best->position.m;
        const auto& c = e.best->covariance_m2;
        append(out, "%.4f,%.4f,%.4f,", p.x(), p.y(), p.z());
        if (c.allFinite())
          append(out, "%.8f,%.8f,%.8f,%.8f,%.8f,%.8f,%.4f,%.4f,", c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2),
                 c(2, 2), e.h95_m, e.v95_m);
        else
          out += ",,,,,,,,";
      } else {
        out += ",,,,,,,,,,,";
      }
      if (e.mirror) {
        append(out, "%.4f,%.4f,%.4f,", e.mirror->position.m.x(), e.mirror->position.m.y(),
               e.mirror->position.m.z());
      } else {
        out += ",,,";
      }
      if (e.best) append(out, "%.4f", e.best->probability);
      append(out, ",%zu,%zu,", e.n_used, total(e.refused));
      if (e.gdop) append(out, "%.3f", *e.gdop);
      append(out, ",%.4f,%.4f,", e.bias_m.value_or(0.0), e.lag_s.value_or(0.0));
      std::string failed;
      for (const Gate& gate : e.gates) {
        if (!gate.passed) failed += (failed.empty() ? "" : " ") + gate.name;
      }
      out += field(e.reason) + (e.acceptable() ? ",1," : ",0,") + failed + "\n";
    }
  }
  return out;
}

}  // namespace anchord
