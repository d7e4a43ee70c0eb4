#include "api/formats/report_sections.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>
#include <string_view>

#include "api/formats/report_svg.hpp"
#include "api/wire/live_writer.hpp"
#include "core/localize/error_budget.hpp"

namespace anchord::report {
namespace {

std::string cell(const std::string& html, const char* css = "num") {
  return "<td class=\"" + std::string(css) + "\">" + html + "</td>";
}
std::string head(const std::string& html, bool number = true) {
  return number ? "<th class=\"num\">" + html + "</th>" : "<th>" + html + "</th>";
}

std::string name_of(const ReportAnchor& anchor) {
  return anchor.name.empty() ? to_string(anchor.estimate.anchor) : anchor.name;
}

std::string spaced(std::string words) {
  std::ranges::replace(words, '_', ' ');
  return words;
}

/// 51.023 159 414
std::string degrees(double value) {
  std::string text = fixed(value, 9);
  if (text.size() > 6 && std::isfinite(value)) {
    text.insert(text.size() - 3, "\u202f");
    text.insert(text.size() - 9, "\u202f");
  }
  return text;
}

std::string state(const ReportAnchor& anchor) {
  if (anchor.overridden) return "<span class=\"chip warn\">◆ OVERRIDDEN</span>";
  if (anchor.published) return "<span class=\"chip ok\">✔ PUBLISHED</span>";
  if (anchor.estimate.acceptable()) return "<span class=\"chip ok\">✔ PASSES</span>";
  return "<span class=\"chip no\">⊖ WITHHELD</span>";
}

bool any_truth(const Report& report) {
  return std::ranges::any_of(report.anchors, [](const ReportAnchor& a) { return a.truth_m.has_value(); });
}

std::string position_row(const Report& report, const ReportAnchor& anchor) {
  const auto& e = anchor.estimate;
  const bool globe = report.frame == TrackFrame::wgs84;
  std::string out = anchor.published || e.acceptable() ? "<tr>" : "<tr class=\"mut\">";
  out += "<td><b>" + html_text(name_of(anchor)) + "</b></td>" + cell(html_text(anchor.place), "") +
         cell(state(anchor), "");
  if (!e.best) {
    out += "<td class=\"num\" colspan=\"5\">no position: " + html_text(e.reason) + "</td>";
  } else {
    const auto& at = e.best->position.m;
    if (globe && e.best->wgs84)
      out += cell(degrees(e.best->wgs84->lat_deg)) + cell(degrees(e.best->wgs84->lon_deg)) +
             cell(fixed(e.best->wgs84->height_m, 3));
    else
      out += cell(fixed(at.x(), 3)) + cell(fixed(at.y(), 3)) + cell(fixed(at.z(), 3));
    out += cell(fixed(e.h95_m, 3)) + cell(fixed(e.v95_m, 3));
  }
  out += cell(std::to_string(e.n_used));
  if (any_truth(report))
    out += cell(anchor.truth_m && e.best ? fixed(distance_m(e.best->position.m, *anchor.truth_m), 3) : "–");
  return out + "</tr>";
}

/// Names of the gates in the order in which the first anchor that has them was asked.
std::vector<std::string> gate_names(const Report& report) {
  std::vector<std::string> names;
  for (const auto& anchor : report.anchors) {
    for (const auto& gate : anchor.estimate.gates) {
      if (std::ranges::find(names, gate.name) == names.end()) names.push_back(gate.name);
    }
  }
  return names;
}

constexpr std::size_t k_gate_columns = 6;

/// What a gate asks, in the words of the dashboard (web/src/ui/gates.ts), and how its numbers are read.
struct GateWords {
  std::string_view name, asks, unit;
  bool least{false};  ///< the value has to be at least the limit; else at most
};
constexpr std::array k_gate_words{
    GateWords{"redundancy", "Number of ranges minus unknowns", "", true},
    GateWords{"rejected", "Ranges rejected", "%"},
    GateWords{"geometry", "Width of the track relative to the distance", "%", true},
    GateWords{"precision", "Largest σ relative to the distance", "%"},
    GateWords{"side", "The mirror solution is excluded", "%", true},
    GateWords{"outline", "Outside the outline of the building", "m"},
    GateWords{"blocked", "Residuals against those of the other anchors", "×"},
    GateWords{"own_delay", "Delay of this anchor's ranges alone", "m"},
    GateWords{"residual_scale", "Size of the residuals", "m"},
    GateWords{"chi_square", "Residuals average out over time", "χ²"},
    GateWords{"halves", "The two halves of the flight agree", "χ²"},
    GateWords{"second_place", "Ranges that agree on another position", "%"},
    GateWords{"flights", "The flights agree", "χ²"},
    GateWords{"datum", "Flights before the site's datum was changed", ""},
    GateWords{"moved", "Same position as before", "χ²"},
    GateWords{"bias", "Range bias of the kit, σ", "m"},
    GateWords{"lever_arm", "The lever arm fits the flight", "σ"},
    GateWords{"clock", "Clock of the ranges against the clock of the track", "s"},
    GateWords{"unseen_arm", "Undetected error that a wrong lever arm would cause", "m"},
    GateWords{"range_scale", "Scale error of the ranges", "%"},
    GateWords{"range_step", "Step of the ranges between low and high", "m"},
    GateWords{"range_drift", "Drift of the ranges over the flight", "m"},
    GateWords{"track_drift", "Drift of the positions over the flight", "m"},
    GateWords{"track_heights", "Factor on the heights of the track", "%"},
    GateWords{"track_shift", "No shift of the track at its gaps", "χ²"},
    GateWords{"track", "Positions shifted together against the others", "%"},
    GateWords{"profile", "The kit agrees with its other flights", "χ²"},
    GateWords{"settled", "Rounds until the joint solution converged", ""},
    GateWords{"target_sigma_m", "σ of the position", "m"},
    GateWords{"goal_h95_m", "95 % horizontal", "m"},
    GateWords{"goal_v95_m", "95 % vertical", "m"},
};
GateWords words_of(std::string_view name) {
  const auto it = std::ranges::find(k_gate_words, name, &GateWords::name);
  return it == k_gate_words.end() ? GateWords{name, name, ""} : *it;
}
std::string gate_number(double value, double limit, const GateWords& words) {
  if (words.unit == "%") return fixed(100 * value, limit < 0.2 ? 1 : 0);
  return fixed(value, words.unit.empty() ? 0 : limit >= 10 ? 1 : 2);
}

std::string gate_limit(const Gate& gate, const GateWords& words) {
  return (words.least ? "≥ " : "≤ ") + gate_number(gate.limit, gate.limit, words) +
         (words.unit.empty() ? "" : " " + std::string(words.unit));
}

/// One limit where all anchors have the same, else each beside its value.
std::string gate_row(std::span<const ReportAnchor> anchors, const std::string& name) {
  const GateWords words = words_of(name);
  const auto gate_of = [&](const ReportAnchor& anchor) -> const Gate* {
    const auto gate = std::ranges::find(anchor.estimate.gates, name, &Gate::name);
    return gate == anchor.estimate.gates.end() ? nullptr : &*gate;
  };
  std::set<std::string> limits;
  for (const auto& anchor : anchors)
    if (const auto* gate = gate_of(anchor)) limits.insert(gate_limit(*gate, words));
  std::string cells;
  for (const auto& anchor : anchors) {
    const auto* gate = gate_of(anchor);
    if (gate == nullptr) {
      cells += cell("–", "num mut");
      continue;
    }
    std::string text = (gate->passed ? "" : "✕ ") +
                       (gate->value ? gate_number(*gate->value, gate->limit, words) : std::string("–"));
    if (limits.size() > 1) text += " (" + gate_limit(*gate, words) + ')';
    cells += cell(text, gate->passed ? "num" : "num bad");
  }
  const std::string limit = limits.empty() ? "–" : limits.size() > 1 ? "each its own" : *limits.begin();
  return "<tr><td>" + html_text(spaced(std::string(words.asks))) + "</td>" + cell(limit, "num mut") + cells +
         "</tr>";
}

/// Where an error comes from, for people.
std::string source_words(const std::string& source) {
  const auto known = k_error_source_words.find(source);
  return known ? std::string(source_text(*known)) : spaced(source);
}

std::string failures(const ReportAnchor& anchor) {
  std::string out;
  for (const auto& gate : anchor.estimate.gates) {
    if (!gate.passed)
      out += (out.empty() ? "" : "; ") + spaced(std::string(words_of(gate.name).asks)) + ": " + gate.why;
  }
  return out;
}

}  // namespace

std::string positions(const Report& report) {
  const bool globe = report.frame == TrackFrame::wgs84;
  std::string out = "<h2>Positions</h2><table><thead><tr>" + head("Anchor", false) + head("Place", false) +
                    head("State", false);
  out += globe ? head("Latitude, °") + head("Longitude, °") + head("Height, m")
               : head("x, m") + head("y, m") + head("z, m");
  out += head("95 % h, m") + head("95 % v, m") + head("Ranges");
  if (any_truth(report)) out += head("Error, m");
  out += "</tr></thead><tbody>";
  for (const auto& anchor : report.anchors) out += position_row(report, anchor);
  out += "</tbody></table><p class=\"note\">";
  out += globe ? "Height is ellipsoidal." : "Coordinates in the local frame of the flights.";
  if (any_truth(report))
    out += " Error is the distance to the given true position, horizontal where that has no height.";
  for (const auto& anchor : report.anchors) {
    if (anchor.overridden)
      out += " <b>" + html_text(name_of(anchor)) + "</b> was published by " +
             html_text(anchor.overridden->by.empty() ? "an unnamed user" : anchor.overridden->by) +
             " although a gate failed; reason: " + html_text(anchor.overridden->reason) + ".";
    else if (!anchor.published && !anchor.estimate.acceptable() && anchor.estimate.best)
      out += " " + html_text(name_of(anchor)) + " is withheld: " +
             html_text(anchor.estimate.reason.empty() ? failures(anchor) : anchor.estimate.reason) + ".";
  }
  return out + "</p>";
}

std::string gates(const Report& report) {
  const auto names = gate_names(report);
  if (names.empty())
    return "<h2>Acceptance gates</h2><p class=\"note\">This calibration was made without gates; a person "
           "must accept each of its anchors.</p>";
  std::string out = "<h2>Acceptance gates</h2>";
  // A gate a row and a few anchors beside each other: so it fits the page, however many there are of either.
  for (std::size_t from = 0; from < report.anchors.size(); from += k_gate_columns) {
    const auto some =
        std::span(report.anchors).subspan(from, std::min(k_gate_columns, report.anchors.size() - from));
    out += "<table class=\"gates\"><thead><tr>" + head("Condition", false) + head("Limit");
    for (const auto& anchor : some) out += head(html_text(name_of(anchor)));
    out += "</tr></thead><tbody>";
    for (const auto& name : names) out += gate_row(some, name);
    out += "</tbody></table>";
  }
  std::string words;
  for (const auto& anchor : report.anchors) {
    const std::string why = failures(anchor);
    if (!why.empty()) words += " <b>" + html_text(name_of(anchor)) + "</b> " + html_text(why) + ".";
  }
  return out +
         "<p class=\"note\">✕ failed. Only an anchor that passes all gates is accepted without a person." +
         words + "</p>";
}

std::string goals(const Report& report) {
  std::string rows;
  for (const auto& anchor : report.anchors) {
    if (!anchor.goal || !anchor.estimate.best) continue;
    std::string values;
    bool within = true;
    for (const auto& gate : goal_gates(anchor.estimate, *anchor.goal)) {
      values += (values.empty() ? "" : ", ") + std::string(words_of(gate.name).asks) + " " +
                (gate.value ? fixed(*gate.value, 3) : "–") + " m (limit ≤ " + fixed(gate.limit, 3) + " m)";
      within = within && gate.passed;
    }
    rows += "<tr><td><b>" + html_text(name_of(anchor)) + "</b></td>" +
            cell(within ? "within" : "✕ over", within ? "" : "bad") + cell(html_text(values), "") +
            cell(html_text(goal_words(*anchor.goal)), "") + "</tr>";
  }
  if (rows.empty()) return {};
  return "<h2>Accuracy goal</h2><table class=\"goals\"><thead><tr>" + head("Anchor", false) +
         head("Goal", false) + head("Accuracy", false) + head("Goal from", false) + "</tr></thead><tbody>" +
         rows +
         "</tbody></table><p class=\"note\">Shows whether an anchor is accurate enough. Acceptance is "
         "decided by the gates alone.</p>";
}

std::string methods(const Report& report) {
  std::string rows;
  const bool truth = any_truth(report);
  for (const auto& anchor : report.anchors) {
    if (!anchor.linear_m && !anchor.wls_m) continue;
    if (!anchor.truth_m && !anchor.estimate.best) continue;
    const Eigen::Vector3d reference = anchor.truth_m ? *anchor.truth_m : anchor.estimate.best->position.m;
    const auto off = [&](const std::optional<Eigen::Vector3d>& at) {
      return cell(at ? fixed(distance_m(*at, reference), 3) : std::string("–"));
    };
    rows +=
        "<tr><td><b>" + html_text(name_of(anchor)) + "</b></td>" + off(anchor.linear_m) + off(anchor.wls_m);
    rows += anchor.truth_m && anchor.estimate.best ? off(anchor.estimate.best->position.m) : cell("–");
    rows += "</tr>";
  }
  if (rows.empty()) return {};
  return "<h2>Methods compared</h2><p class=\"note\">Distance to " +
         std::string(truth ? "the truth" : "the joint solution") +
         ", m. Linear: eq 7.2 to 7.5, closed form. Weighted: eq 7.10, each anchor alone, weights of 7.2.3. "
         "Joint: "
         "all anchors with bias, range curve, lag and arms, robust.</p><table><thead><tr>" +
         head("Anchor", false) + head("Linear") + head("Weighted") + head("Joint") + "</tr></thead><tbody>" +
         rows + "</tbody></table>";
}

std::string budgets(const Report& report) {
  std::string rows, words;
  std::vector<std::string> sources;
  for (const auto& anchor : report.anchors) {
    if (anchor.budget.shares.empty()) continue;
    if (sources.empty())
      for (const auto& [source, share] : anchor.budget.shares) sources.push_back(source);
    rows += "<tr><td><b>" + html_text(name_of(anchor)) + "</b></td>";
    for (const auto& source : sources) {
      const auto at = std::ranges::find(anchor.budget.shares, source, [](const auto& s) { return s.first; });
      rows +=
          at == anchor.budget.shares.end() ? cell("–", "num mut") : cell(fixed(100 * at->second, 0) + " %");
    }
    rows += cell(html_text(anchor.budget.help), "") + "</tr>";
  }
  if (rows.empty()) return {};
  std::string out = "<h2>Error budget</h2><table><thead><tr>" + head("Anchor", false);
  for (const auto& source : sources) out += head(html_text(source_words(source)));
  return out + head("What would help most", false) + "</tr></thead><tbody>" + rows +
         "</tbody></table><p class=\"note\">Shares of the covariance's trace: the part that would vanish if "
         "the source were known perfectly.</p>";
}

std::string rejected(const Report& report) {
  std::set<std::string> reasons;
  for (const auto& anchor : report.anchors) {
    for (const auto& [why, n] : anchor.estimate.refused) reasons.insert(why);
  }
  if (reasons.empty()) return {};
  std::string out = "<h2>Ranges not used</h2><table><thead><tr>" + head("Anchor", false) + head("used");
  for (const auto& why : reasons) out += head(html_text(spaced(why)));
  out += "</tr></thead><tbody>";
  for (const auto& anchor : report.anchors) {
    out += "<tr><td><b>" + html_text(name_of(anchor)) + "</b></td>" +
           cell(std::to_string(anchor.estimate.n_used));
    for (const auto& why : reasons) {
      const auto found = anchor.estimate.refused.find(why);
      out +=
          found == anchor.estimate.refused.end() ? cell("–", "num mut") : cell(std::to_string(found->second));
    }
    out += "</tr>";
  }
  return out + "</tbody></table>";
}

std::string flights(const Report& report) {
  if (report.evidence.flights.empty()) return {};
  std::string out = "<h2>Calibration of the kit, per flight</h2><table><thead><tr>" + head("Flight", false) +
                    head("Kit", false) + head("Bias, m (σ)") + head("Curve, m per e-fold (σ)") +
                    head("Lag, s (σ)") + head("Antenna up, m (σ)") + head("Ranges used") +
                    "</tr></thead><tbody>";
  const auto valued = [](const Valued& v) {
    return fixed(v.value, 3) + " <span class=\"u\">(" + fixed(v.sigma, 3) + ")</span>";
  };
  std::string words;
  for (const auto& flight : report.evidence.flights) {
    const auto& s = flight.shared;
    out += "<tr>" + cell(html_text(flight.name), "") +
           cell(html_text(flight.kit.empty() ? "–" : flight.kit), "") +
           cell(s.bias_determined ? valued(s.bias_m) : "<span class=\"bad\">not determined</span>") +
           cell(valued(s.curve_m)) + cell(valued(s.lag_s)) + cell(valued(s.lever_up_m)) +
           cell(std::to_string(flight.n_used) + " of " + std::to_string(flight.n_ranges)) + "</tr>";
    for (const auto& note : flight.notes) words += (words.empty() ? "" : " · ") + html_text(note);
  }
  out += "</tbody></table>";
  return words.empty() ? out : out + "<p class=\"note\">" + words + "</p>";
}

std::string iterations(const Report& report) {
  std::string plots, rows;
  bool truth = false;
  for (const auto& anchor : report.anchors) {
    const auto found = report.evidence.course.find(anchor.estimate.anchor);
    if (found == report.evidence.course.end() || found->second.empty()) continue;
    if (!anchor.truth_m && !anchor.estimate.best) continue;
    const auto& steps = found->second;
    const Eigen::Vector3d reference = anchor.truth_m ? *anchor.truth_m : anchor.estimate.best->position.m;
    truth = truth || anchor.truth_m.has_value();
    // A range error is in space: a truth without a height gets that of the solution.
    Eigen::Vector3d space_m = reference;
    if (!std::isfinite(space_m.z()) && anchor.estimate.best)
      space_m.z() = anchor.estimate.best->position.m.z();
    plots += "<div><h3>" + html_text(name_of(anchor)) + ": position</h3>" + course(steps, reference) +
             "</div><div><h3>" + html_text(name_of(anchor)) + ": range</h3>" + range_course(steps, space_m) +
             "</div>";
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const auto error = [&](const std::optional<Eigen::Vector3d>& at) {
        return at ? fixed(distance_m(*at, reference), 3) : std::string("–");
      };
      const RangeErrors ranges = range_errors(steps[i], space_m);
      rows += "<tr>" + cell(i == 0 ? "<b>" + html_text(name_of(anchor)) + "</b>" : "", "") +
              cell(std::to_string(i + 1)) + cell(std::to_string(steps[i].n_ranges)) +
              cell(error(steps[i].raw_m)) + cell(error(steps[i].corrected_m)) +
              cell(steps[i].corrected_m ? fixed(steps[i].h95_m, 3) : "–") + cell(fixed(ranges.raw_m, 3)) +
              cell(fixed(ranges.corrected_m, 3)) +
              cell(std::to_string(steps[i].n_los) + " : " + std::to_string(steps[i].n_nlos)) +
              cell(std::string(k_verdict_words.word(steps[i].verdict)), "num mut") + "</tr>";
    }
  }
  if (plots.empty()) return {};
  const char* against = truth ? "the truth" : "the final position";
  return "<h2>Error per iteration, raw and corrected</h2><p class=\"note\">Distance to " +
         std::string(against) +
         " after each further part of the flight; beside it the error of the median range of that part, and "
         "below it the class that a model predicted for most of its ranges (L line of sight, N not line of "
         "sight, – no prediction). "
         "<i class=\"key\" "
         "style=\"color:var(--caution)\"></i><span>raw "
         "ranges</span><i class=\"key\" style=\"color:var(--info)\"></i><span>corrected</span><i "
         "class=\"key\" "
         "style=\"color:var(--edge);border-top-style:dashed\"></i><span>claimed 95 %, horizontal</span></p>"
         "<div class=\"plots\">" +
         plots + "</div><table style=\"margin-top:10px\"><thead><tr>" + head("Anchor", false) +
         head("Iteration") + head("Ranges") + head("Raw, m") + head("Corrected, m") +
         head("Claimed 95 %, m") + head("Range raw, m") + head("Range corrected, m") + head("LOS : NLOS") +
         head("Verdict") + "</tr></thead><tbody>" + rows + "</tbody></table>";
}

std::string residual_plots(const Report& report) {
  std::string plots;
  for (const auto& anchor : report.anchors) {
    std::vector<const std::vector<RangeResidual>*> rows;
    for (const auto& flight : report.evidence.flights) {
      const auto found = flight.residuals.find(anchor.estimate.anchor);
      if (found != flight.residuals.end()) rows.push_back(&found->second);
    }
    if (rows.empty()) continue;
    plots += "<div><h3>" + html_text(name_of(anchor)) + "</h3>" + residuals(rows) + "</div>";
  }
  if (plots.empty()) return {};
  return "<h2>Residuals, m, over time</h2><p class=\"note\">Corrected range minus distance; · used, <span "
         "class=\"bad\">×</span> rejected. A pattern that persists is an error of the model, not "
         "noise.</p><div "
         "class=\"plots\">" +
         plots + "</div>";
}

}  // namespace anchord::report
