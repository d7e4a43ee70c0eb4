#include "api/learning/campaign_rows.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/formats/binary_file.hpp"
#include "api/formats/campaign.hpp"
#include "api/kit/problem.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr double k_latest_s = 4e9;  // the year 2096: what is more is of another unit

CampaignFormat format_of(const Request& request) {
  std::string_view type = request.header("content-type");
  type = type.substr(0, type.find(';'));
  if (type == "text/csv") return CampaignFormat::csv;
  if (type == "application/x-ndjson" || type == "application/ndjson" || type == "application/jsonl")
    return CampaignFormat::ndjson;
  if (type == "text/plain") return CampaignFormat::txt;
  throw_problem(415, "media-type", "send Content-Type text/csv, application/x-ndjson or text/plain");
}

/// Settings are told apart by their names; where the source gives none, by what is true of them.
std::string name_of(const CampaignSite& site) {
  if (!site.name.empty()) return site.name;
  const auto part = [](const std::optional<double>& value) {
    return value ? to_wire(nlohmann::json(*value)) : std::string("-");
  };
  return site.environment + "/" + part(site.distance_m) + "/" + part(site.heading_deg) + "/" +
         part(site.height_m) + "/" + site.material + "/" + part(site.thickness_m) + "/" +
         (site.los ? (*site.los ? "los" : "nlos") : "-");
}

Ordered lines_json(const std::vector<CampaignLineError>& lines) {
  Ordered out = Ordered::array();
  for (const auto& one : lines)
    out.push_back({{"line", one.line},
                   {"column", one.column.empty() ? Ordered(nullptr) : Ordered(one.column)},
                   {"detail", one.detail}});
  return out;
}

Ordered report_json(const CampaignReport& report) {
  Ordered dropped = Ordered::array(), settings = Ordered::array();
  for (const auto& [reason, drop] : report.dropped)
    dropped.push_back({{"reason", reason}, {"count", drop.count}, {"first", lines_json(drop.first)}});
  for (const auto& site : report.sites)
    settings.push_back({{"setting", site.name},
                        {"kept", site.kept},
                        {"zero", site.zero},
                        {"outliers", site.outliers},
                        {"median_m", site.median_m},
                        {"sd_m", site.sd_m}});
  Ordered classes = Ordered::array();
  for (const auto& [column, value] : report.classes) classes.push_back({{"column", column}, {"los", value}});
  return {{"read", report.lines},          {"kept", report.kept},
          {"dropped", std::move(dropped)}, {"errors", lines_json(report.errors)},
          {"warnings", report.warnings},   {"unused", report.unused},
          {"classes", std::move(classes)}, {"settings", std::move(settings)}};
}

}  // namespace

CampaignRows read_campaign_rows(const Request& request) {
  CampaignOptions options;
  options.format = format_of(request);
  auto& d = options.defaults;
  d.name = request.query_value("setting").value_or("");
  d.environment = request.query_value("environment").value_or("");
  d.material = request.query_value("material").value_or("");
  d.distance_m = query_number(request, "distance_m", 0.01, 10'000);
  d.heading_deg = query_number(request, "heading_deg", -720, 720);
  d.height_m = query_number(request, "height_difference_m", -1000, 1000);
  d.thickness_m = query_number(request, "thickness_m", 0, 100);
  options.los_value = request.query_value("los_value").value_or("");
  if (request.query_value("los")) d.los = query_flag(request, "los");
  // Excel writes UTF-16 with its mark; whatever else is no UTF-8 is refused with what to do.
  const bool wide = request.body.starts_with("\xFF\xFE") || request.body.starts_with("\xFE\xFF");
  if (const auto what = binary_file(request.body); !what.empty())
    throw_problem(422, "validation", what, {{"", "unreadable", what}});
  const auto read = import_campaign(wide ? request.body : text_body(request), options);
  if (!read)
    throw_problem(422, "validation", read.error().message, {{"", "unreadable", read.error().message}});
  const auto& campaign = read.value().campaign;
  CampaignRows out;
  std::size_t odd_times = 0, first_odd = 0;
  for (const auto& m : campaign.measurements) {
    const auto& site = campaign.sites[m.site];
    CampaignRow row;
    auto& t = row.truth;
    t.setting = name_of(site);
    t.environment = site.environment;
    t.distance_m = site.distance_m;
    t.los = site.los;
    t.heading_deg = site.heading_deg;
    t.height_difference_m = site.height_m;
    t.material = site.material;
    t.thickness_m = site.thickness_m;
    t.truth_sigma_m = site.truth_sd_m;
    auto& x = row.sample;
    if (m.t_s && !(*m.t_s > 0 && *m.t_s < k_latest_s) && odd_times++ == 0) first_odd = m.line;
    if (m.t_s && *m.t_s > 0 && *m.t_s < k_latest_s) {
      // Whole microseconds, as exports have them; several rangings may share one stamp.
      x.time = UtcTime::from_us(std::llround(*m.t_s * 1e6));
      x.seq = m.line;
    }
    x.range_m = m.range_m;
    x.rx_dbm = m.rx_dbm;
    x.fp_dbm = m.fp_dbm;
    x.fp_amp1 = m.fp_amp1;
    x.fp_amp2 = m.fp_amp2;
    x.fp_amp3 = m.fp_amp3;
    x.cir_power = m.cir_power;
    x.preamble_count = m.preamble_count;
    x.std_noise = m.std_noise;
    x.max_noise = m.max_noise;
    x.fp_index = m.fp_index;
    x.cir = m.cir;
    out.rows.push_back(std::move(row));
  }
  auto report = report_json(read.value().report);
  // Those about names come together with what is stored.
  report["warnings"] = read.value().report.oddities;
  if (odd_times > 0)
    report["warnings"].push_back("the times of " + std::to_string(odd_times) +
                                 " rows are no seconds since 1970 and are left out, the first in line " +
                                 std::to_string(first_odd) +
                                 ": t_s is in seconds, t_ms in milliseconds, t_us in microseconds");
  out.report_json = to_wire(report);
  if (out.rows.size() == 1) out.untimed = CampaignStore::Untimed::fresh;
  return out;
}

}  // namespace anchord::api
