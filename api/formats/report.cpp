#include "api/formats/report.hpp"

#include <algorithm>
#include <cmath>

#include "api/formats/report_sections.hpp"
#include "api/formats/report_svg.hpp"

namespace anchord {
namespace {

using report::fixed;

// Looks follow the dashboard's light theme: ink for text and rules, colour only where it means a state.
constexpr const char* k_style = R"css(
@page{size:A4;margin:14mm 15mm 12mm}
:root{--ink:#000;--ink2:#434b55;--ink3:#5a6068;--line:#d6dbe1;--edge:#7e8791;--ok:#0b6b2e;--caution:#8a4b00;--bad:#b00020;--info:#0b57a4;--okw:#e4f2e8;--inset:#eef1f4}
*{box-sizing:border-box}
html{background:#e9edf0}
body{margin:0;overflow-wrap:anywhere;font:11px/1.45 system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans",Cantarell,"Liberation Sans",sans-serif;color:var(--ink);font-variant-numeric:tabular-nums;-webkit-print-color-adjust:exact;print-color-adjust:exact}
.sheet{width:210mm;min-height:296mm;margin:8mm auto;padding:14mm 15mm 12mm;background:#fff;display:flex;flex-direction:column}
@media print{html{background:#fff}.sheet{width:auto;min-height:270mm;margin:0;padding:0}.sheet+.sheet{break-before:page}}
.top{display:flex;align-items:flex-end;justify-content:space-between;border-bottom:2px solid #000;padding-bottom:9px}
h1{font-size:24px;line-height:1.1;letter-spacing:-.02em;margin:0}.top p{margin:4px 0 0;font-size:12.5px;color:var(--ink2)}
.top .rev{text-align:right}.top b{font-size:22px;font-weight:500;line-height:1.1}
.meta{display:grid;grid-template-columns:repeat(4,1fr);gap:7px 18px;padding:10px 0 12px}
.lab{display:block;font-size:10.5px;color:var(--ink3)}.meta .v{font-size:12.5px;font-weight:500}
.fig{display:grid;grid-template-columns:minmax(0,1fr) 172px;gap:16px}
.map{display:block;width:100%;border:1px solid var(--edge);background:#fff}
.acc{display:flex;flex-direction:column;gap:9px}.acc>div{border-top:1px solid var(--edge);padding-top:6px}
.acc .v{display:block;font-size:24px;font-weight:500;line-height:1.1;letter-spacing:-.02em}.u{color:var(--ink2);font-weight:400}
.acc p,.note{margin:5px 0 0;font-size:10.5px;color:var(--ink2)}
h2{font-size:13.5px;margin:15px 0 4px}h3{font-size:11px;margin:0 0 2px;font-weight:600}
table{border-collapse:collapse;width:100%}th{font-size:10.5px;font-weight:600;color:var(--ink2);text-align:left;padding:0 6px 4px 0;vertical-align:bottom}
td{height:23px;padding:2px 6px 2px 0;border-top:1px solid var(--line);vertical-align:middle}tr:last-child td{border-bottom:1px solid var(--line)}
thead+tbody tr:first-child td{border-top-color:var(--edge)}
tr{break-inside:avoid}thead{display:table-header-group}.num{text-align:right;white-space:nowrap}th.num{white-space:normal}.mut,.mut td{color:var(--ink3)}
.chip{white-space:nowrap;font-weight:600}.chip.ok{color:var(--ok)}.chip.warn{color:var(--caution)}.chip.no{color:var(--ink3)}.chip.bad,.bad{color:var(--bad)}
.cols{display:grid;grid-template-columns:1fr 1fr;gap:20px}.cols p{margin:0 0 4px}
.sig{display:grid;grid-template-columns:1fr 1fr 1fr;gap:20px;margin-top:auto;padding-top:34px;break-inside:avoid}.sig>div{border-top:1px solid #000;padding-top:4px;height:34px}
footer{display:flex;justify-content:space-between;gap:20px;border-top:1px solid var(--edge);padding-top:6px;margin-top:8px;font-size:10px;color:var(--ink3)}
.plots{display:grid;grid-template-columns:1fr 1fr;gap:10px 18px}.plots>div{break-inside:avoid}.plot{display:block;width:100%}
.key{display:inline-block;width:14px;height:0;border-top:2px solid;vertical-align:middle;margin:0 4px 0 0}.key+span{margin-right:12px}
svg text{font:10px system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans",sans-serif;fill:var(--ink2)}
svg .id{font-weight:600;fill:#000;paint-order:stroke;stroke:#fff;stroke-width:3px}svg .t{paint-order:stroke;stroke:#fff;stroke-width:3px}
table.gates{margin-bottom:8px;overflow-wrap:break-word}table.gates td{white-space:normal}table.gates td:first-child{min-width:18ch}table.gates th.num{min-width:7ch;overflow-wrap:anywhere}
@media screen and (max-width:720px){body{font-size:13px}.sheet{width:auto;min-height:0;margin:0 0 8px;padding:16px}.meta{grid-template-columns:1fr 1fr}.fig,.cols,.plots,.sig{grid-template-columns:minmax(0,1fr)}table{display:block;overflow-x:auto}th,.lab,.acc p,.note,footer{font-size:12px}.top{flex-wrap:wrap;gap:8px}}
.plot text.t{font-size:8.5px;stroke:none;fill:var(--ink3)}
.grid{stroke:#e3e6e9;stroke-width:1}.axis{stroke:var(--edge);stroke-width:1}.wall{fill:none;stroke:#39424c;stroke-width:2.5}
.track{fill:none;stroke:#a9b2bb;stroke-width:1}.link{stroke:var(--caution);stroke-dasharray:2 3}.mirror{fill:none;stroke:var(--caution);stroke-dasharray:3 2}
.scale{fill:none;stroke:#000;stroke-width:1.6}.ell{stroke-width:1.4}.ell.good{fill:#0b6b2e21;stroke:var(--ok)}.ell.over{fill:#8a4b0021;stroke:var(--caution)}.ell.held{fill:none;stroke:var(--edge);stroke-dasharray:3 2}
.dot{stroke:#fff;stroke-width:1}.dot.good{fill:var(--ok)}.dot.over{fill:var(--caution)}.dot.held{fill:#fff;stroke:var(--ink3);stroke-width:1.5}.dash{stroke:var(--ink3);stroke-width:1.5}.tick{fill:none;stroke:#fff;stroke-width:1.6}
.pt{fill:#39424c;fill-opacity:.55}.rej{fill:none;stroke:var(--bad);stroke-width:.9}
.raw{fill:none;stroke:var(--caution);stroke-width:1.6}.cor{fill:none;stroke:var(--info);stroke-width:2}.raw.m{fill:var(--caution)}.cor.m{fill:var(--info)}.claim{fill:none;stroke:var(--edge);stroke-width:1.2;stroke-dasharray:3 3}
)css";

std::string top(const Report& r) {
  std::string when = to_rfc3339(r.created);
  when = when.substr(0, 10) + ", " + when.substr(11, 5) + " UTC";
  return "<div class=\"top\"><div><h1>" + html_text(r.title) + "</h1><p>" + html_text(r.subtitle) +
         "</p></div><div class=\"rev\"><b>" + html_text(r.heading) + "</b><p>" + when + "</p></div></div>";
}

std::string facts(const Report& r) {
  std::string out = "<div class=\"meta\">";
  for (const auto& [name, value] : r.facts)
    out += "<div><span class=\"lab\">" + html_text(name) + "</span><span class=\"v\">" + html_text(value) +
           "</span></div>";
  return out + "</div>";
}

/// The panel beside the map: how many, how well to the base, how well on the globe.
std::string accuracy(const Report& r) {
  std::size_t taken = 0;
  double worst_m = 0;
  const bool published =
      std::ranges::any_of(r.anchors, [](const ReportAnchor& anchor) { return anchor.published; });
  for (const auto& anchor : r.anchors) {
    if (published ? !anchor.published : !anchor.estimate.acceptable()) continue;
    ++taken;
    worst_m = std::max(worst_m, anchor.estimate.h95_m);
  }
  const auto block = [](const std::string& name, const std::string& value, const std::string& unit) {
    return "<div><span class=\"lab\">" + name + "</span><span class=\"v\">" + value + " <span class=\"u\">" +
           unit + "</span></span></div>";
  };
  std::string out = "<div class=\"acc\">";
  out += block(published ? "Anchors published" : "Anchors that pass every gate", std::to_string(taken),
               "of " + std::to_string(r.anchors.size()));
  out += block("95 % horizontal, to the base", taken > 0 ? fixed(worst_m, 3) : "–", "m, of the worst anchor");
  const bool base = r.site && r.site->base_sigma_m && r.frame == TrackFrame::wgs84;
  // 95 % of the base's own error in the plane is 2.4477 sigma.
  out += block("95 % horizontal, absolute",
               base && taken > 0 ? fixed(std::hypot(worst_m, 2.4477 * *r.site->base_sigma_m), 3) : "–",
               "m, of the worst anchor");
  out += "<div><p><b>Two accuracies.</b> The first is to the base station. The second adds the base";
  out += base ? ", with σ " + fixed(*r.site->base_sigma_m * 1000, 0) + " mm" +
                    (r.site->crs_frame.empty() ? "" : " in " + html_text(r.site->crs_frame)) + ".</p></div>"
              : ", whose own uncertainty is not stated.</p></div>";
  return out + "</div>";
}

std::string sentences(const char* title, const std::vector<std::string>& lines) {
  std::string out = "<div><h2>" + std::string(title) + "</h2>";
  for (const auto& line : lines) out += "<p>" + html_text(line) + "</p>";
  return out + "</div>";
}

std::string footer(const Report& r, const char* right) {
  return "<footer><span>" + html_text(r.program) +
         (r.calibration.empty() ? "" : ", calibration " + html_text(r.calibration)) + "</span><span>" +
         right + "</span></footer>";
}

}  // namespace

std::string html_text(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    // U+FFFE and U+FFFF are no characters of XML 1.0 (section 2.2), however they are written.
    if (const auto three = text.substr(i, 3); three == "\xEF\xBF\xBE" || three == "\xEF\xBF\xBF") {
      out += "\xEF\xBF\xBD";
      i += 2;
      continue;
    }
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t') out += c;
    }
  }
  return out;
}

std::string report_html(const Report& r) {
  std::string out =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>" +
      html_text(r.title + ", " + r.subtitle) + "</title><style>" + k_style + "</style></head><body>\n";
  out += "<section class=\"sheet\">" + top(r) + facts(r) + "<div class=\"fig\">" + report::map(r) +
         accuracy(r) + "</div>\n";
  out += report::positions(r);
  out += "<div class=\"cols\">" + sentences("Method", r.methods) + sentences("Remarks", r.remarks) + "</div>";
  out +=
      "<div class=\"sig\"><div><span class=\"lab\">Flown by</span></div><div><span class=\"lab\">Checked "
      "by</span></div><div><span class=\"lab\">Accepted by, date</span></div></div>";
  out += footer(r, "evidence on the next page") + "</section>\n";
  out += "<section class=\"sheet\">" + report::gates(r) + report::goals(r) + report::budgets(r) +
         report::methods(r) + report::rejected(r) + report::flights(r) + report::iterations(r) +
         report::residual_plots(r) + "<div style=\"margin-top:auto\"></div>" + footer(r, "end of report") +
         "</section>\n</body></html>\n";
  return out;
}

}  // namespace anchord
