#include "api/formats/campaign.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>

#include "api/formats/binary_file.hpp"
#include "api/formats/campaign_text.hpp"
#include "api/formats/cells.hpp"
#include "api/formats/class_words.hpp"
#include "api/formats/column_names.hpp"
#include "api/formats/csv_record.hpp"
#include "api/formats/names_alike.hpp"
#include "api/formats/text_decoding.hpp"
#include "api/kit/reader.hpp"
#include "api/wire/row_limits.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/ml/dataset.hpp"
#include "core/ml/plausible.hpp"

namespace anchord::api {
namespace {

using namespace columns;
constexpr std::size_t k_most_errors = 100;
constexpr double k_furthest_m = row_limits::k_campaign_range_m.max;

bool has_unit(std::string_view name) {
  return name.ends_with("_m") || name.ends_with("_mm") || name.ends_with("_cm");
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r'))
    text.remove_suffix(1);
  return text;
}

// Fields of one line by name; a view into the line or the document.
using Row = std::map<std::string, std::string, std::less<>>;

// The cell of the first of the names that has something in it; null where none has.
const Row::value_type* cell(const Row& row, const Names& names) {
  for (const auto name : names)
    if (const auto at = row.find(name); at != row.end() && !at->second.empty()) return &*at;
  return nullptr;
}

// The same, of those that say something: "n/a" in one column leaves the next.
const Row::value_type* telling_cell(const Row& row, const Names& names) {
  for (const auto name : names)
    if (const auto at = row.find(name); at != row.end() && !says_nothing(at->second)) return &*at;
  return nullptr;
}

std::optional<std::string> find(const Row& row, const Names& names) {
  if (const auto* found = cell(row, names)) return found->second;
  return std::nullopt;
}

constexpr const char* k_unreadable = "unreadable line";
constexpr const char* k_impossible = "impossible value";
constexpr const char* k_missing = "missing value";

// Why a line cannot be used; the first thing wrong with it.
struct Fault {
  const char* reason{nullptr};  // null: nothing wrong
  std::string column{}, detail{};

  void set(const char* why, std::string_view where, std::string what) {
    if (!reason) {
      reason = why;
      column = where;
      detail = std::move(what);
    }
  }
};

std::string in_quotes(std::string_view text) { return '"' + to_utf8(text, 40) + '"'; }

class Importer {
 public:
  explicit Importer(const CampaignOptions& options)
      : options_{options}, defaults_{options.defaults}, classes_{options.los_value} {}

  Result<CampaignImport> run(std::string_view text) {
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    if (const auto what = binary_file(text); !what.empty()) return make_error(Errc::bad_frame, what);
    if (text.find('\0') != std::string_view::npos)
      return make_error(Errc::bad_frame,
                        "no text: it has bytes of zero in it (UTF-16 without its mark?); save it as UTF-8");
    out_.report.format = options_.format == CampaignFormat::detect ? detect(text) : options_.format;
    std::size_t line = 0;
    while (!text.empty()) {
      const auto end = text.find('\n');
      auto one = text.substr(0, end);
      text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
      ++line;
      if (one.ends_with('\r')) one.remove_suffix(1);
      // A tab at the end of a table's line is an empty cell.
      if (out_.report.format != CampaignFormat::csv || trimmed(one).empty()) one = trimmed(one);
      if (!one.empty()) take_line(one, line);
      if (fatal_) return *fatal_;
    }
    if (out_.campaign.measurements.empty() && out_.report.lines == 0)
      return make_error(Errc::bad_frame, "no measurement in the file");
    if (const auto why = unit_conflict(ratios_, spelled(ratio_range_), spelled(ratio_truth_)); !why.empty())
      return make_error(Errc::invalid_argument, why);
    if (!classes_.met())
      return make_error(Errc::invalid_argument,
                        "no row has the class " + in_quotes(classes_.los_value()) +
                            " that is said to mean LOS in a column that does not say it by its name");
    finish();
    return std::move(out_);
  }

 private:
  static CampaignFormat detect(std::string_view text) {
    while (!text.empty()) {
      const auto end = text.find('\n');
      const auto line = trimmed(text.substr(0, end));
      text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
      if (line.empty() || line.front() == '#') continue;
      if (line.front() == '{') return CampaignFormat::ndjson;
      // What has any other word in it is a header, and must then have a column of ranges.
      return is_campaign_line(line) ? CampaignFormat::txt : CampaignFormat::csv;
    }
    return CampaignFormat::txt;
  }

  void take_line(std::string_view line, std::size_t number_of_line) {
    if (line.front() == '#') {
      take_comment(trimmed(line.substr(1)), number_of_line);
      return;
    }
    switch (out_.report.format) {
      case CampaignFormat::csv:
        return take_csv(line, number_of_line);
      case CampaignFormat::ndjson:
        return take_json(line, number_of_line);
      case CampaignFormat::txt:
      case CampaignFormat::detect:
        return take_txt(line, number_of_line);
    }
  }

  // "# key = value" or "# key: value": ground truth of the lines that follow.
  void take_comment(std::string_view text, std::size_t number_of_line) {
    const auto at = text.find_first_of("=:");
    if (at == std::string_view::npos) return;
    std::string value{trimmed(text.substr(at + 1))};
    if (const auto parsed = cell_number(value, true); parsed && value.find(',') != std::string::npos)
      value[value.find(',')] = '.';
    const auto key = trimmed(text.substr(0, at));
    const auto known = known_name(key);
    const Row row{{std::string{known.empty() ? key : known}, std::move(value)}};
    Fault fault;
    auto changed = site_of(row, defaults_, fault);
    if (fault.reason) return refuse(number_of_line, std::move(fault));
    defaults_ = std::move(changed);
  }

  void take_csv(std::string_view line, std::size_t at) {
    if (header_.empty()) {
      if (const char named = separator_named_by(line); named != '\0') {
        separator_ = named;
        separator_named_ = true;
        return;
      }
      if (!separator_named_) separator_ = separator_of(line);
    }
    CsvRecord record({separator_});
    const auto read = record.read(line);
    const auto& cells = record.cells();
    if (header_.empty()) {
      if (!read)
        fatal_ = make_error(Errc::bad_frame, "line " + std::to_string(at) + ": " + read.error().message);
      header_.assign(cells.begin(), cells.end());
      if (!fatal_) fatal_ = fault_of_header(at);
      return;
    }
    ++out_.report.lines;
    if (!read) return refuse(at, {k_unreadable, {}, read.error().message});
    if (cells.size() != header_.size())
      return refuse(at, {k_unreadable, {}, wrong_cell_count(cells.size(), header_.size(), separator_)});
    Row row;
    for (std::size_t c = 0; c < cells.size(); ++c)
      if (!known_[c].empty()) row.emplace(known_[c], cells[c]);
    take_row(row, at);
  }

  std::optional<Error> fault_of_header(std::size_t at) {
    const std::string line = "line " + std::to_string(at) + ": ";
    for (auto name = header_.begin(); name != header_.end(); ++name) {
      const auto known = known_name(*name);
      known_.push_back(known);
      if (known.empty()) {
        note_unused(*name);
      } else if (const auto [twin, fresh] = spelling_.try_emplace(std::string(known), *name); !fresh) {
        return make_error(Errc::invalid_argument,
                          line +
                              (twin->second == *name ? "two columns are named " + in_quotes(*name)
                                                     : "columns " + in_quotes(twin->second) + " and " +
                                                           in_quotes(*name) + " are one name here") +
                              ": rename or remove one");
      }
      if (!name->empty() && std::find(header_.begin(), name, *name) != name)
        return make_error(Errc::invalid_argument,
                          line + "two columns are named " + in_quotes(*name) + ": rename or remove one");
    }
    const auto has = [this](const Names& names) {
      return std::ranges::any_of(
          names, [this](auto name) { return std::ranges::find(known_, name) != known_.end(); });
    };
    if (has(k_range) || (has(k_truth) && has(k_distance))) return std::nullopt;
    std::string columns;
    for (const auto& name : header_) columns += (columns.empty() ? "" : ", ") + in_quotes(name);
    return make_error(
        Errc::invalid_argument,
        line + "no column of measured ranges (range_m, or range_mm for millimetres); read with \"" +
            (separator_ == '\t' ? std::string("tab") : std::string(1, separator_)) +
            "\" between cells, the columns are " + columns.substr(0, 600) +
            ": is there a header? Name the columns in the first line, or give a .txt of time in ms, distance "
            "in mm and RSS in dBm");
  }

  void take_json(std::string_view line, std::size_t at) {
    ++out_.report.lines;
    nlohmann::json object;
    if (const auto fault = parse_json(line, object)) return refuse(at, {k_unreadable, {}, fault->detail});
    if (!object.is_object()) return refuse(at, {k_unreadable, {}, "not a JSON object"});
    Row row;
    std::optional<Cir> cir;
    for (const auto& [key, value] : object.items()) {
      if (value.is_null()) continue;
      if (key == "truth" && value.is_object()) {  // as this server gives samples out
        for (const auto& [name, of] : value.items()) {
          if (of.is_null() || of.is_structured()) continue;
          const std::string text = of.is_boolean()  ? (of.get<bool>() ? "1" : "0")
                                   : of.is_string() ? of.get<std::string>()
                                                    : to_wire(of);
          row.insert_or_assign(name == "distance_m" ? "true_distance_m" : key_of(name), text);
        }
      } else if (key == "features" || key == "predicted") {
        continue;  // computed from what else the line has
      } else if (key == "cir" && value.is_object()) {
        std::vector<FieldError> errors;
        cir = read_cir(value, "/cir", errors);
        if (!errors.empty())
          return refuse(at, {k_impossible, key, errors.front().pointer + " " + errors.front().detail});
      } else if (key == "cir") {
        return refuse(at, {k_impossible, key,
                           "cir is no object of n, first_path_idx, dt_ps and b64 as a range has it"});
      } else if (value.is_boolean())
        row.emplace(key_of(key), value.get<bool>() ? "1" : "0");
      else if (value.is_string())
        row.emplace(key_of(key), value.get<std::string>());
      else if (value.is_number())
        row.emplace(key_of(key), to_wire(value));
      else
        return refuse(at, {k_impossible, key, key + " is neither a number nor text"});
    }
    take_row(row, at, std::move(cir));
  }

  void take_txt(std::string_view line, std::size_t at) {
    ++out_.report.lines;
    auto read = read_campaign_line(line);
    if (!read.fault.empty())
      return refuse(at, {read.too_few ? k_missing : k_unreadable, {}, std::move(read.fault)});
    if (read.rss_dbm && !row_limits::k_dbm.hold(*read.rss_dbm))
      return refuse(at, {k_impossible, "rss", "no level: " + in_quotes(line)});
    CampaignMeasurement m;
    m.t_s = read.t_ms / 1000;
    m.range_m = read.distance_mm / 1000;
    m.rx_dbm = read.rss_dbm;
    keep(defaults_, std::move(m), at);
  }

  void take_row(const Row& row, std::size_t at, std::optional<Cir> cir = std::nullopt) {
    Fault fault;
    auto site = site_of(row, defaults_, fault);
    CampaignMeasurement m;
    std::string range_column;
    const auto value = [&](const Names& names, double low, double high) -> std::optional<double> {
      const auto* found = cell(row, names);
      if (!found || says_nothing(found->second)) return std::nullopt;
      const auto parsed = number(found->second);
      if (!parsed)
        fault.set(k_impossible, found->first, not_a_number(*found));
      else if (*parsed < low || *parsed > high)
        fault.set(k_impossible, found->first,
                  spelled(found->first) + " impossible: " + in_quotes(found->second));
      return parsed;
    };
    const auto range = [&](const Names& names) -> std::optional<double> {
      const auto* where = telling_cell(row, names);
      if (!where) return std::nullopt;
      // A name without a unit is metres, and no radio measures so many.
      const double metres = metres_per_unit(where->first).value_or(1);
      range_column = where->first;
      const auto found = value({where->first}, 0,
                               has_unit(where->first) ? k_furthest_m / metres : row_limits::k_distance_m.max);
      return found ? std::optional{in_metres(*found, where->first)} : std::nullopt;
    };
    const auto has_name = [&row](auto name) { return row.contains(name); };
    auto range_m = range(k_range);
    // A distance is the measured one where another column holds the truth and none the range.
    if (!range_m && std::ranges::none_of(k_range, has_name) && find(row, k_truth))
      range_m = range(k_distance);
    if (const auto named = std::ranges::find_if(k_range, has_name);
        range_column.empty() && named != k_range.end())
      range_column = *named;
    if (range_m && site.distance_m) note_ratio(row, range_column, *range_m / *site.distance_m);
    if (!range_m) fault.set(k_missing, range_column, "no measured range (range_m, range_cm or range_mm)");
    constexpr double k_any = 1e300;
    const auto bounded = [&](const Names& names, const Bounds& bounds) {
      return value(names, bounds.min, bounds.max);
    };
    m.t_s = value(k_seconds, -k_any, k_any);
    if (!m.t_s)
      if (const auto ms = value(k_milliseconds, -k_any, k_any)) m.t_s = *ms / 1000;
    if (!m.t_s)
      if (const auto us = value(k_microseconds, -k_any, k_any)) m.t_s = *us / 1e6;
    m.rx_dbm = bounded(k_rx, row_limits::k_dbm);
    m.fp_dbm = bounded(k_fp, row_limits::k_dbm);
    m.fp_amp1 = bounded(k_f1, row_limits::k_register);
    m.fp_amp2 = bounded(k_f2, row_limits::k_register);
    m.fp_amp3 = bounded(k_f3, row_limits::k_register);
    m.cir_power = bounded(k_cir_power, row_limits::k_register);
    m.preamble_count = bounded(k_count, row_limits::k_register);
    m.std_noise = bounded(k_std_noise, row_limits::k_register);
    m.max_noise = bounded(k_max_noise, row_limits::k_register);
    m.fp_index = bounded(k_fp_index, row_limits::k_register);
    if (fault.reason) return refuse(at, std::move(fault));
    m.range_m = *range_m;
    m.cir = std::move(cir);
    keep(site, std::move(m), at, range_column);
  }

  std::optional<double> number(std::string_view text) const { return cell_number(text, separator_ != ','); }
  std::string not_a_number(const Row::value_type& where) const {
    return spelled(where.first) + " is not a number: " + in_quotes(where.second) +
           (where.second.find(',') == std::string::npos
                ? ""
                : " (with decimal commas, separate the cells by semicolons or tabs; write no thousands)");
  }

  CampaignSite site_of(const Row& row, CampaignSite site, Fault& fault) {
    const auto text = [&](const Names& names, std::string& out) {
      auto found = find(row, names);
      if (!found) return;
      // The apostrophe by which an export keeps spreadsheets from running a cell is no part of it.
      if (found->size() > 1 && found->front() == '\'' &&
          std::string_view("=+-@").find((*found)[1]) != std::string_view::npos)
        found->erase(0, 1);
      out = std::move(*found);
    };
    const auto value = [&](const Names& names, double low, double high, std::optional<double>& out,
                           bool length = false) {
      const auto* found = length ? telling_cell(row, names) : cell(row, names);
      if (!found || says_nothing(found->second)) return;
      auto parsed = number(found->second);
      if (parsed && length) *parsed = in_metres(*parsed, found->first);
      if (!parsed || *parsed < low || *parsed > high)
        return fault.set(k_impossible, found->first,
                         spelled(found->first) + " impossible: " + in_quotes(found->second));
      out = parsed;
    };
    constexpr auto truth_m = row_limits::k_campaign_truth_m;
    text(k_site_name, site.name);
    text(k_environment, site.environment);
    text(k_material, site.material);
    // In a .txt header and beside a range column, distance_m is the truth.
    if (telling_cell(row, k_truth))
      value(k_truth, truth_m.min, truth_m.max, site.distance_m, true);
    else if (find(row, k_range) || row.size() == 1)
      value(k_distance_truth, truth_m.min, truth_m.max, site.distance_m, true);
    value(k_heading, -360, 720, site.heading_deg);
    value(k_site_height, -1000, 1000, site.height_m);
    value(k_thickness, 0, 100, site.thickness_m);
    value(k_truth_sd, 0, 100, site.truth_sd_m);
    take_class(row, site, fault);
    return site;
  }

  /// The first column that can be read counts, those first that say by their names what 0 and 1 mean.
  void take_class(const Row& row, CampaignSite& site, Fault& fault) {
    using enum ClassReader::Said;
    Fault unreadable_one;
    std::optional<bool> said;
    for (const auto name : k_label) {
      const auto found = row.find(name);
      if (found == row.end() || (said && !ClassReader::says_it(name))) continue;
      const auto read = classes_.read(spelled(name), found->second);
      switch (read) {
        case nothing:
          break;
        case untold:
          fatal_ = make_error(Errc::invalid_argument, untold_class(spelled(name), found->second));
          return;
        case unreadable:
          unreadable_one.set(k_impossible, name,
                             spelled(name) + " is neither LOS nor NLOS: " + in_quotes(found->second));
          break;
        case los:
        case nlos:
          if (said && *said != (read == los))
            return fault.set(k_impossible, name, spelled(name) + " contradicts another column of the class");
          said = read == los;
      }
    }
    if (said)
      site.los = said;
    else if (unreadable_one.reason)
      fault.set(unreadable_one.reason, unreadable_one.column, unreadable_one.detail);
  }

  /// The key by which a line is read, and a note where nothing is taken from it.
  std::string key_of(const std::string& key) {
    const auto known = known_name(key);
    if (known.empty()) note_unused(key);
    if (!known.empty() && known != key) spelling_.try_emplace(std::string(known), key);
    return known.empty() ? key : std::string(known);
  }
  std::string spelled(std::string_view known) const {
    const auto at = spelling_.find(known);
    return at == spelling_.end() ? std::string(known) : at->second;
  }
  void note_unused(const std::string& name) {
    if (!name.empty() && name != "id" && name != "seq" && unused_.insert(name).second)
      out_.report.unused.push_back(name);
  }
  void note_ratio(const Row& row, const std::string& range_column, double ratio) {
    ratios_.add(ratio, 1);
    if (ratios_.values.size() != 1) return;
    ratio_range_ = range_column;
    const auto* truth = telling_cell(row, k_truth);
    if (!truth) truth = telling_cell(row, k_distance_truth);
    ratio_truth_ = truth ? truth->first : "the true distance that was given";
  }

  void keep(const CampaignSite& site, CampaignMeasurement m, std::size_t at, const std::string& column = {}) {
    m.site = index_of(site);
    m.line = at;
    auto& report = out_.report.sites[m.site];
    if (m.range_m == 0) {  // the radio's way to say that there was no answer (5.2)
      count("zero range",
            {at, spelled(column), "the radio reports a range of zero when an anchor does not answer"});
      ++report.zero;
      return;
    }
    if (!row_limits::k_campaign_range_m.hold(m.range_m))
      return refuse(at,
                    {k_impossible, column,
                     "range impossible: " + metres(m.range_m) +
                         (m.range_m > 0 && m.range_m < 1
                              ? ", shorter than any radio measures (a .txt and range_mm are in millimetres)"
                              : "")});
    out_.campaign.measurements.push_back(std::move(m));
  }

  std::size_t index_of(const CampaignSite& site) {
    auto& sites = out_.campaign.sites;
    // Neighbouring lines are of one site as a rule.
    if (last_ < sites.size() && sites[last_] == site) return last_;
    const auto found = std::find(sites.begin(), sites.end(), site);
    last_ = static_cast<std::size_t>(found - sites.begin());
    if (found == sites.end()) {
      sites.push_back(site);
      out_.report.sites.emplace_back();
      out_.report.sites.back().name = site.name.empty() ? "site " + std::to_string(sites.size()) : site.name;
    }
    return last_;
  }

  void count(const char* reason, CampaignLineError error) {
    auto& drop = out_.report.dropped[reason];
    ++drop.count;
    if (drop.first.size() < CampaignDrop::k_most_named) drop.first.push_back(std::move(error));
  }

  void refuse(std::size_t at, Fault fault) {
    CampaignLineError error{at, spelled(fault.column), std::move(fault.detail)};
    if (out_.report.errors.size() < k_most_errors) out_.report.errors.push_back(error);
    count(fault.reason, std::move(error));
  }

  static std::string metres(double value_m) {
    std::array<char, 40> text{};
    std::snprintf(text.data(), text.size(), "%.3f m", value_m);
    return text.data();
  }

  void finish() {
    auto& measurements = out_.campaign.measurements;
    std::vector<double> range;
    std::vector<std::uint32_t> site;
    for (const auto& m : measurements) {
      range.push_back(m.range_m);
      site.push_back(static_cast<std::uint32_t>(m.site));
    }
    std::vector<bool> outlier(measurements.size(), false);
    if (options_.filter)
      for (const auto i : ml::range_outliers(range, site, options_.outlier_mads, options_.outlier_floor_m))
        outlier[i] = true;
    std::vector<CampaignMeasurement> kept;
    std::vector<std::vector<double>> of_site(out_.campaign.sites.size());
    for (std::size_t i = 0; i < measurements.size(); ++i) {
      const std::size_t s = measurements[i].site;
      if (outlier[i]) {
        ++out_.report.sites[s].outliers;
        count("range far from the median of its site",
              {measurements[i].line, {}, metres(measurements[i].range_m)});
        continue;
      }
      of_site[s].push_back(measurements[i].range_m);
      kept.push_back(std::move(measurements[i]));
    }
    measurements = std::move(kept);
    out_.report.kept = measurements.size();
    for (std::size_t s = 0; s < of_site.size(); ++s) summarise(of_site[s], out_.report.sites[s]);
    std::vector<std::string> environments, sites;
    for (const auto& one : out_.campaign.sites) {
      environments.push_back(one.environment);
      sites.push_back(one.name);
    }
    out_.report.warnings = names_alike("environments", environments);
    for (auto& warning : names_alike("settings", sites)) out_.report.warnings.push_back(std::move(warning));
    std::size_t n = 0, implausible = 0;
    for (const auto& m : measurements) {
      const auto& truth = out_.campaign.sites[m.site].distance_m;
      if (!truth) continue;
      ++n;
      if (!ml::plausible_range(m.range_m, m.range_m - *truth)) ++implausible;
    }
    if (auto odd = implausible_ranges(implausible, n); !odd.empty())
      out_.report.oddities.push_back(std::move(odd));
    out_.report.unused = in_runs(out_.report.unused);
    out_.report.classes = classes_.taken();
  }

  static void summarise(std::vector<double>& values, CampaignReport::Site& out) {
    out.kept = values.size();
    if (values.empty()) return;
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    out.median_m = n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
    double mean = 0, sum = 0;
    for (const double v : values) mean += v / static_cast<double>(n);
    for (const double v : values) sum += (v - mean) * (v - mean);
    if (n > 1) out.sd_m = std::sqrt(sum / static_cast<double>(n - 1));
  }

  const CampaignOptions& options_;
  CampaignSite defaults_;
  ClassReader classes_;
  std::vector<std::string> header_;
  std::vector<std::string_view> known_;                         // of the header; empty: no name of the tables
  std::map<std::string, std::string, std::less<>> spelling_{};  // of the source, by known name
  std::set<std::string> unused_{};
  Ratios ratios_{};
  std::string ratio_range_{}, ratio_truth_{};
  char separator_{','};
  bool separator_named_{false};
  std::size_t last_{static_cast<std::size_t>(-1)};
  std::optional<Error> fatal_;
  CampaignImport out_;
};

}  // namespace

Result<CampaignImport> import_campaign(std::string_view text, const CampaignOptions& options) {
  const bool wide = text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF");
  const std::string narrow = wide ? decoded(text) : std::string();
  return Importer{options}.run(wide ? std::string_view(narrow) : text);
}

}  // namespace anchord::api
