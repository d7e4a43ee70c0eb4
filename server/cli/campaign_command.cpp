#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "api/formats/campaign.hpp"
#include "api/formats/cells.hpp"
#include "core/base/text.hpp"
#include "core/base/whole_file.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/learning_data.hpp"
#include "server/cli/terminal_text.hpp"
#include "server/cli/words.hpp"

namespace anchord::cli {
namespace {

struct CampaignArguments {
  std::string file, out, environment, material, site, label, los_value;
  api::CampaignFormat format{api::CampaignFormat::detect};
  double distance_m{-1}, heading_deg{0}, height_m{0}, thickness_m{0};
  bool has_heading{false}, has_height{false}, has_thickness{false}, keep_outliers{false};
};

api::CampaignOptions options_of(const CampaignArguments& a) {
  api::CampaignOptions o;
  o.format = a.format;
  o.filter = !a.keep_outliers;
  o.los_value = a.los_value;
  o.defaults.name = a.site;
  o.defaults.environment = a.environment;
  o.defaults.material = a.material;
  if (a.distance_m > 0) o.defaults.distance_m = a.distance_m;
  if (a.has_heading) o.defaults.heading_deg = a.heading_deg;
  if (a.has_height) o.defaults.height_m = a.height_m;
  if (a.has_thickness) o.defaults.thickness_m = a.thickness_m;
  if (!a.label.empty()) o.defaults.los = a.label == "LOS";
  return o;
}

void print_report(const api::CampaignReport& r, std::FILE* to) {
  std::fprintf(to, "%zu measurements, %zu kept, %zu sites\n", r.lines, r.kept, r.sites.size());
  for (const auto& [reason, drop] : r.dropped) {
    std::fprintf(to, "  dropped %zu: %s\n", drop.count, printable(reason).c_str());
    for (const auto& e : drop.first)
      std::fprintf(to, "    line %zu: %s\n", e.line, printable(e.detail).c_str());
    if (drop.count > drop.first.size())
      std::fprintf(to, "    and %zu more\n", drop.count - drop.first.size());
  }
  for (const auto& [column, value] : r.classes)
    std::fprintf(to, "  class: %s of column %s is LOS\n", printable(value).c_str(),
                 printable(column).c_str());
  const std::string unused = api::listed_briefly(r.unused);
  if (!unused.empty()) std::fprintf(to, "  columns not used: %s\n", printable(unused).c_str());
  for (const auto& warning : r.warnings) std::fprintf(to, "  warning: %s\n", printable(warning).c_str());
  for (const auto& odd : r.oddities) std::fprintf(to, "  warning: %s\n", printable(odd).c_str());
  for (const auto& s : r.sites)
    std::fprintf(to, "  %-24s %6zu kept, %zu zero, %zu outliers, median %.3f m, sd %.3f m\n",
                 one_line(s.name).c_str(), s.kept, s.zero, s.outliers, s.median_m, s.sd_m);
}

int import(const CampaignArguments& a) {
  const auto text = whole_text(a.file);
  if (!text) return refuse("campaign", text.error().message);
  const auto read = api::import_campaign(text.value(), options_of(a));
  if (!read) return refuse("campaign", a.file + ": " + read.error().message);
  if (read.value().report.kept == 0) {
    print_report(read.value().report, stderr);
    return refuse("campaign", a.file + ": no row can be used; nothing is written");
  }
  if (a.out.empty()) {
    std::fputs(api::campaign_csv(read.value().campaign).c_str(), stdout);
    print_report(read.value().report, stderr);
    return 0;
  }
  if (const auto written = write_whole(a.out, api::campaign_csv(read.value().campaign)); !written)
    return failed("anchord campaign", written.error().message);
  print_report(read.value().report, stdout);
  return 0;
}

}  // namespace

void add_campaign_command(CLI::App& app, int& exit_code) {
  auto* campaign = app.add_subcommand("campaign", "Measurement campaigns: ranges with ground truth");
  campaign->require_subcommand(1);
  auto a = std::make_shared<CampaignArguments>();
  auto* command = campaign->add_subcommand("import",
                                           "Read CSV, NDJSON or a .txt file of one measurement per line, "
                                           "reject faults, write one CSV to train on");
  command->add_option("file", a->file, "Input file, plain or gzipped")->required();
  command->add_option("--out", a->out, "CSV to write (default: standard output)");
  add_word(*command, "--format", a->format, api::k_campaign_format_words, "Of the file");
  command->add_option("--site", a->site, "Name of the site, for files that have none");
  command->add_option("--environment", a->environment,
                      "Environment, like hall or office: never divided between training and test");
  command->add_option("--material", a->material, "Of the obstacle");
  command->add_option("--distance-m", a->distance_m, "True distance")->check(CLI::PositiveNumber);
  auto* heading = command->add_option("--heading-deg", a->heading_deg, "Heading of the tag");
  auto* height = command->add_option("--height-m", a->height_m, "Height difference of the antennas");
  auto* thickness = command->add_option("--thickness-m", a->thickness_m, "Of the obstacle");
  command->add_option("--label", a->label, "LOS or NLOS")->check(CLI::IsMember({"LOS", "NLOS"}));
  command->add_option("--los-value", a->los_value,
                      "Value that means LOS in a column of the class that does not say it by its name");
  command->add_flag("--keep-outliers", a->keep_outliers, "Drop zero ranges only");
  command->callback([a, heading, height, thickness, &exit_code] {
    a->has_heading = heading->count() > 0;
    a->has_height = height->count() > 0;
    a->has_thickness = thickness->count() > 0;
    exit_code = import(*a);
  });
}

}  // namespace anchord::cli
