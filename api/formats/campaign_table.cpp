#include <algorithm>
#include <array>
#include <charconv>

#include "api/formats/campaign.hpp"

namespace anchord::api {

LabelledTable table_of(const Campaign& campaign) {
  LabelledTable out;
  out.grouping = Grouping::column;
  out.group_by = "environment";
  out.placement_by = "site";
  std::map<std::string, std::uint32_t> places;
  for (const auto& m : campaign.measurements) {
    const auto& site = campaign.sites[m.site];
    const std::string place =
        site.environment.empty() ? "site " + std::to_string(m.site + 1) : site.environment;
    const auto [at, fresh] = places.try_emplace(place, static_cast<std::uint32_t>(places.size()));
    if (fresh) out.group_names.push_back(place);
    nlos::DiagnosticSample s;
    s.range_m = m.range_m;
    s.rx_dbm = m.rx_dbm;
    s.fp_dbm = m.fp_dbm;
    s.fp_amp1 = m.fp_amp1;
    s.fp_amp2 = m.fp_amp2;
    s.fp_amp3 = m.fp_amp3;
    s.cir_power = m.cir_power;
    s.preamble_count = m.preamble_count;
    s.std_noise = m.std_noise;
    s.max_noise = m.max_noise;
    s.fp_index = m.fp_index;
    s.height_difference_m = site.height_m;
    s.heading_deg = site.heading_deg;
    out.features.push_back(nlos::compute_features(s));
    out.range_m.push_back(m.range_m);
    out.true_range_m.push_back(site.distance_m);
    out.los.push_back(site.los);
    out.group.push_back(at->second);
    out.placement.push_back(static_cast<std::uint32_t>(m.site));
    if (site.los) out.label_column = "los";
    if (site.distance_m) out.truth_column = "true_distance_m";
  }
  out.rows_read = out.rows();
  return out;
}

std::string campaign_csv(const Campaign& campaign) {
  std::string out =
      "site,environment,material,true_distance_m,heading_deg,height_m,thickness_m,los,truth_sd_m,t_s,range_m,"
      "rx_dbm,fp_dbm,fp_amp1,fp_amp2,fp_amp3,cir_pwr,rxpacc,std_noise,max_noise,fp_index\n";
  const auto put = [&out](std::optional<double> value) {
    out += ',';
    if (!value) return;
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), *value).ptr;
    out.append(text.data(), end);
  };
  const auto word = [&out](std::string text) {  // commas would tear the line
    std::replace(text.begin(), text.end(), ',', ';');
    std::replace(text.begin(), text.end(), '\n', ' ');
    out += text;
  };
  for (const auto& m : campaign.measurements) {
    const auto& s = campaign.sites[m.site];
    word(s.name);
    out += ',';
    word(s.environment);
    out += ',';
    word(s.material);
    put(s.distance_m);
    put(s.heading_deg);
    put(s.height_m);
    put(s.thickness_m);
    out += s.los ? (*s.los ? ",1" : ",0") : ",";
    put(s.truth_sd_m);
    put(m.t_s);
    put(m.range_m);
    put(m.rx_dbm);
    put(m.fp_dbm);
    put(m.fp_amp1);
    put(m.fp_amp2);
    put(m.fp_amp3);
    put(m.cir_power);
    put(m.preamble_count);
    put(m.std_noise);
    put(m.max_noise);
    put(m.fp_index);
    out += '\n';
  }
  return out;
}

}  // namespace anchord::api
