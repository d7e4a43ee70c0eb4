#include "api/formats/labelled_table.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

#include "api/formats/binary_file.hpp"
#include "api/formats/cells.hpp"
#include "api/formats/cir_table.hpp"
#include "api/formats/class_words.hpp"
#include "api/formats/column_names.hpp"
#include "api/formats/csv_record.hpp"
#include "api/formats/gzip_lines.hpp"
#include "api/formats/names_alike.hpp"
#include "api/formats/time_unit.hpp"
#include "api/wire/row_limits.hpp"
#include "core/ml/plausible.hpp"

namespace anchord::api {
namespace {

using namespace columns;

const Names k_group{"group",    "env",     "environment", "place",   "room",
                    "campaign", "session", "setup",       "tag_pos", "anchor_height_m"};
const Names k_placement{"setup_id", "placement", "setup", "setting", "measurement_point"};
const Names k_time{"t_s", "unix_s", "t_us", "time_s", "t_ms"};
constexpr std::size_t k_no_column = static_cast<std::size_t>(-1);
constexpr std::size_t k_many_unused = 32;
constexpr std::size_t k_time_blocks = 10, k_times_looked_at = 1000;
constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();

Error at_line(const std::string& file, const GzipLines& lines, const std::string& what) {
  return make_error(Errc::bad_frame, file + ":" + std::to_string(lines.line_number()) + ": " + what);
}

double number_or_nan(std::string_view cell, bool decimal_comma = false) {
  return cell_number(cell, decimal_comma).value_or(k_nan);
}

std::optional<double> finite(double value) { return std::isnan(value) ? std::nullopt : std::optional{value}; }

struct Header {
  std::vector<std::string> names;
  std::size_t of(std::string_view name) const {
    const auto at = std::find(names.begin(), names.end(), name);
    return at == names.end() ? k_no_column : static_cast<std::size_t>(at - names.begin());
  }
  std::size_t first(const Names& candidates) const {
    return first_of(names, candidates).value_or(k_no_column);
  }
};

class Ids {
 public:
  std::uint32_t of(const std::string& name) {
    const auto [at, fresh] = ids_.try_emplace(name, static_cast<std::uint32_t>(names_.size()));
    if (fresh) names_.push_back(name);
    return at->second;
  }
  std::vector<std::string> names() const { return names_; }

 private:
  std::unordered_map<std::string, std::uint32_t> ids_;
  std::vector<std::string> names_;
};

class TableReader {
 public:
  TableReader(const TableOptions& options, bool several_files)
      : options_{options}, several_files_{several_files}, classes_{options.los_value, true} {}

  Result<void> read(const std::filesystem::path& path, const CirTable* cir) {
    BOOST_OUTCOME_TRY(auto lines, GzipLines::open(path));
    file_ = path.string();
    std::string_view line;
    BOOST_OUTCOME_TRY(const bool any, lines.next(line));
    if (!any) return make_error(Errc::bad_frame, file_ + ": empty file, a header line is needed");
    if (const auto what = binary_file(line); !what.empty())
      return make_error(Errc::bad_frame, file_ + ": " + what);
    if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
    if (line.starts_with("\xFF\xFE") || line.starts_with("\xFE\xFF") ||
        line.find('\0') != std::string_view::npos)
      return make_error(Errc::bad_frame,
                        file_ + ": UTF-16, as Excel's \"Unicode text\" is: save it as CSV UTF-8");
    char separator = separator_named_by(line);
    if (separator != '\0') {
      BOOST_OUTCOME_TRY(const bool header, lines.next(line));
      if (!header) return make_error(Errc::bad_frame, file_ + ": a header line is needed below sep=");
    }
    if (separator == '\0') separator = separator_of(line);
    decimal_comma_ = separator != ',';
    out_.file_names.push_back(file_);
    CsvRecord record({separator});
    const auto& cells = record.cells();
    if (const auto read = record.read(line); !read) return at_line(file_, lines, read.error().message);
    BOOST_OUTCOME_TRY(take_header(cells));
    std::vector<std::size_t> joins;
    if (cir) {
      for (const auto& name : cir->join_names) {
        joins.push_back(header_.of(name));
        if (joins.back() == k_no_column)
          return make_error(Errc::not_found,
                            file_ + ": the CIR table is joined by column " + name + ", which does not exist");
      }
    }
    while (true) {
      BOOST_OUTCOME_TRY(const bool more, lines.next(line));
      if (!more) break;
      if (line.empty()) continue;
      if (const auto read = record.read(line); !read) return at_line(file_, lines, read.error().message);
      if (cells.size() != header_.names.size())
        return at_line(file_, lines, wrong_cell_count(cells.size(), header_.names.size(), separator));
      ++out_.rows_read;
      const std::vector<float>* taps = nullptr;
      if (cir) {
        const auto found = cir->taps.find(joined(cells, joins));
        if (found != cir->taps.end()) taps = &found->second;
      }
      if (cir && taps == nullptr)
        drop("no CIR in the CIR table", lines.line_number());
      else
        take_row(cells, lines.line_number(), taps);
      if (fatal_) return *fatal_;
    }
    return boost::outcome_v2::success();
  }

  Result<LabelledTable> finish() {
    if (range_ != k_no_column && truth_ != k_no_column)
      if (const auto why = unit_conflict(ratios_, header_.names[range_], header_.names[truth_]); !why.empty())
        return make_error(Errc::invalid_argument, file_ + ": " + why);
    if (out_.rows() == 0 && label_ != k_no_column && !unreadable_class_.empty() && options_.los_value.empty())
      return make_error(Errc::invalid_argument,
                        file_ + ": " + untold_class(header_.names[label_], unreadable_class_));
    if (out_.rows() == 0)
      return make_error(Errc::too_few_observations,
                        file_ + ": no usable row among " + std::to_string(out_.rows_read));
    if (!classes_.met())
      return make_error(Errc::invalid_argument, file_ + ": no row of column " + out_.label_column + " is \"" +
                                                    options_.los_value + "\"");
    if (const auto at = classes_.taken().find(out_.label_column); at != classes_.taken().end())
      out_.los_value = at->second;
    look_for_oddities();
    if (out_.grouping == Grouping::time_block) {
      for (std::size_t i = 0; i < out_.rows(); ++i)
        out_.group[i] = static_cast<std::uint32_t>(i * k_time_blocks / out_.rows());
      for (std::size_t b = 0; b < k_time_blocks; ++b)
        out_.group_names.push_back("block " + std::to_string(b));
    } else {
      out_.group_names = groups_.names();
    }
    return std::move(out_);
  }

 private:
  Result<std::size_t> column(const std::string& name) const {
    const auto at = header_.of(name);
    if (at == k_no_column)
      return make_error(Errc::not_found, file_ + ": no column " + name + "; the columns are " + columns());
    return at;
  }

  std::string columns() const {
    std::string known;
    for (const auto& n : header_.names) {
      if (known.size() > 600) return known + ", ...";
      known += (known.empty() ? "" : ", ") + n;
    }
    return known;
  }

  Result<void> take_header(const std::vector<std::string_view>& cells) {
    Header fresh;
    for (const auto cell : cells) fresh.names.emplace_back(cell);
    if (!header_.names.empty()) {
      return follow_header(std::move(fresh));
    }
    header_ = std::move(fresh);
    const bool has_range = header_.first(k_range) != k_no_column;
    range_ = has_range ? header_.first(k_range) : header_.first(k_distance);
    if (!options_.range.empty()) {
      BOOST_OUTCOME_TRY(range_, column(options_.range));
    }
    if (range_ == k_no_column && (truth_given() || no_levels()))
      return make_error(Errc::not_found,
                        file_ +
                            ": no column of measured ranges (range_m, distance_m): name it with --range; "
                            "the columns are " +
                            columns());
    label_ = header_.first(k_label);
    if (!options_.label.empty()) {
      BOOST_OUTCOME_TRY(label_, column(options_.label));
    }
    truth_ = header_.first(k_truth);
    if (truth_ == k_no_column && has_range && options_.range.empty())
      truth_ = header_.first(k_distance_truth);
    if (!options_.truth.empty()) {
      BOOST_OUTCOME_TRY(truth_, column(options_.truth));
    }
    for (const auto c : {range_, truth_})
      if (c != k_no_column && !metres_per_unit(header_.names[c]))
        return make_error(Errc::invalid_argument, file_ + ": column " + header_.names[c] +
                                                      " is in a unit that is not read: convert it to metres");
    if (label_ != k_no_column) out_.label_column = header_.names[label_];
    other_labels_.clear();
    for (const auto& name : k_label) {
      const auto at = header_.of(name);
      if (options_.label.empty() && ClassReader::says_it(name) && at != k_no_column && at != label_)
        other_labels_.push_back(at);
    }
    if (truth_ != k_no_column) out_.truth_column = header_.names[truth_];
    BOOST_OUTCOME_TRY(choose_groups());
    BOOST_OUTCOME_TRY(choose_placements());
    out_.raw_names = header_.names;
    find_raw_columns();
    find_unused();
    BOOST_OUTCOME_TRYV(refuse_twins());
    return boost::outcome_v2::success();
  }

  /// Columns that say something to this reader; the others may still be features by their names.
  std::set<std::size_t> used_columns() const {
    std::set<std::size_t> out{range_, label_, truth_, header_.first(k_time)};
    out.insert(group_columns_.begin(), group_columns_.end());
    out.insert(placement_columns_.begin(), placement_columns_.end());
    for (const auto& [names, at] : level_columns_) out.insert(at);
    for (const std::string_view name :
         {"truth_sigma_m", "truth_sd_m", "truth_accuracy_m", "setup", "idx", "seq"})
      out.insert(header_.of(name));
    return out;
  }

  void find_unused() {
    const auto used = used_columns();
    for (std::size_t c = 0; c < header_.names.size(); ++c)
      if (!used.contains(c) && !header_.names[c].empty()) out_.unused.push_back(header_.names[c]);
    // A feature is looked up by its own name: runs are of impulse responses, which only --cir brings.
    if (out_.unused.size() > k_many_unused) {
      const auto runs = in_runs(out_.unused);
      for (const auto& one : runs)
        if (bare_name(one).starts_with("cir") && one.ends_with(" columns)"))
          out_.warnings.push_back(one +
                                  " are impulse responses in the table and are not used: --cir takes them "
                                  "from a second one");
      out_.unused = runs;
    }
  }

  /// Of two columns of one name nobody knows which is meant: one that is used is refused, others are told.
  Result<void> refuse_twins() {
    const auto used = used_columns();
    for (std::size_t c = 0; c < header_.names.size(); ++c) {
      const auto first = header_.of(header_.names[c]);
      if (first == c || header_.names[c].empty()) continue;
      if (used.contains(first))
        return make_error(Errc::invalid_argument, file_ + ": columns " + std::to_string(first + 1) + " and " +
                                                      std::to_string(c + 1) + " are both named " +
                                                      header_.names[c] + ": rename or remove one");
      out_.warnings.push_back("columns " + std::to_string(first + 1) + " and " + std::to_string(c + 1) +
                              " are both named " + header_.names[c] + "; only the first can be a feature");
    }
    return boost::outcome_v2::success();
  }

  void look_for_oddities() {
    if (const auto at = header_.first(k_time); at != k_no_column) {
      const auto odd = time_unit_warning(header_.names[at], times_);
      if (!odd.empty()) out_.warnings.push_back(odd);
    }
    const auto places = groups_.names(), placements = out_.placement_names;
    for (auto& warning : names_alike("places", places)) out_.warnings.push_back(std::move(warning));
    for (auto& warning : names_alike("placements", placements)) out_.warnings.push_back(std::move(warning));
    std::size_t n = 0, implausible = 0;
    for (std::size_t i = 0; i < out_.rows(); ++i) {
      if (!out_.true_range_m[i] || !(out_.range_m[i] > 0)) continue;
      ++n;
      if (!ml::plausible_range(out_.range_m[i], out_.range_m[i] - *out_.true_range_m[i])) ++implausible;
    }
    if (auto odd = implausible_ranges(implausible, n); !odd.empty()) out_.warnings.push_back(std::move(odd));
  }

  // A later file may have its columns in another order, lack some that are no one's role, and have others.
  Result<void> follow_header(Header fresh) {
    const Header before = std::move(header_);
    header_ = std::move(fresh);
    std::vector<std::size_t*> roles{&range_, &label_, &truth_};
    for (auto& c : group_columns_) roles.push_back(&c);
    for (auto& c : placement_columns_) roles.push_back(&c);
    for (auto* role : roles) {
      if (*role == k_no_column) continue;
      BOOST_OUTCOME_TRY(*role, column(before.names[*role]));
    }
    find_raw_columns();
    return boost::outcome_v2::success();
  }

  void find_raw_columns() {
    raw_columns_.clear();
    for (const auto& name : out_.raw_names) raw_columns_.push_back(header_.of(name));
    for (const auto* names : {&k_rx, &k_fp, &k_f1, &k_f2, &k_f3, &k_cir_power, &k_count, &k_std_noise,
                              &k_max_noise, &k_fp_index, &k_height, &k_heading})
      level_columns_[names] = header_.first(*names);
  }

  Result<void> choose_groups() {
    for (const auto& name : options_.group_by) {
      BOOST_OUTCOME_TRY(const auto at, column(name));
      group_columns_.push_back(at);
    }
    if (group_columns_.empty() && header_.first(k_group) != k_no_column)
      group_columns_.push_back(header_.first(k_group));
    out_.grouping = !group_columns_.empty()                ? Grouping::column
                    : several_files_                       ? Grouping::file
                    : header_.first(k_time) != k_no_column ? Grouping::time_block
                                                           : Grouping::row;
    for (const auto c : group_columns_)
      out_.group_by += (out_.group_by.empty() ? "" : ",") + header_.names[c];
    if (out_.grouping == Grouping::file) out_.group_by = "file";
    if (out_.grouping == Grouping::time_block) out_.group_by = "time block";
    return boost::outcome_v2::success();
  }

  Result<void> choose_placements() {
    for (const auto& name : options_.placement) {
      BOOST_OUTCOME_TRY(const auto at, column(name));
      placement_columns_.push_back(at);
    }
    const auto add = [&](std::size_t at) {
      if (at != k_no_column) placement_columns_.push_back(at);
    };
    if (placement_columns_.empty()) add(header_.first(k_placement));
    if (placement_columns_.empty() && header_.of("tag_pos") != k_no_column &&
        header_.of("anchor_id") != k_no_column) {
      add(header_.of("tag_pos"));
      add(header_.of("anchor_id"));
    }
    // A true range that repeats names its placement, together with the place and the class.
    if (placement_columns_.empty() && truth_ != k_no_column) {
      placement_columns_ = group_columns_;
      placed_by_truth_ = true;
      add(truth_);
      add(label_);
    }
    for (const auto c : placement_columns_)
      out_.placement_by += (out_.placement_by.empty() ? "" : ",") + header_.names[c];
    return boost::outcome_v2::success();
  }

  /// Nothing where the row is to be left out, with the reason counted.
  std::optional<bool> class_of(std::string_view cell, std::size_t line) {
    const auto& name = header_.names[label_];
    switch (classes_.read(name, cell)) {
      case ClassReader::Said::los:
        return true;
      case ClassReader::Said::nlos:
        return false;
      case ClassReader::Said::nothing:
        drop(name + " missing", line);
        return std::nullopt;
      case ClassReader::Said::untold:
        fatal_ = make_error(Errc::invalid_argument,
                            file_ + ":" + std::to_string(line) + ": " + untold_class(name, cell));
        return std::nullopt;
      case ClassReader::Said::unreadable:
        break;
    }
    if (unreadable_class_.empty()) unreadable_class_ = cell;
    drop(name + " is neither 0 nor 1, LOS nor NLOS", line);
    return std::nullopt;
  }

  /// Another column that says the class by its name says the other one; empty: none does.
  std::string contradicting(const std::vector<std::string_view>& cells, bool los) {
    for (const auto at : other_labels_) {
      const auto said = beside_.read(header_.names[at], cells[at]);
      if (said == (los ? ClassReader::Said::nlos : ClassReader::Said::los)) return header_.names[at];
    }
    return {};
  }

  bool truth_given() const { return !options_.truth.empty() || header_.first(k_truth) != k_no_column; }
  bool no_levels() const {
    for (const auto* names : {&k_rx, &k_fp, &k_f1, &k_cir_power, &k_std_noise})
      if (header_.first(*names) != k_no_column) return false;
    return true;
  }

  void drop(const std::string& reason, std::size_t line) {
    auto& entry = out_.dropped[reason];
    if (entry.first++ == 0) entry.second = file_ + ":" + std::to_string(line);
  }

  /// -999 and its like, by which loggers say that there is no level, are none.
  bool drop_impossible(std::size_t line) {
    for (const auto& [names, at] : level_columns_) {
      if (at == k_no_column || std::isnan(values_[at])) continue;
      const bool level = names == &k_rx || names == &k_fp;
      if (names == &k_height || names == &k_heading) continue;
      const auto& bounds = level ? row_limits::k_dbm : row_limits::k_register;
      if (bounds.hold(values_[at])) continue;
      drop(header_.names[at] +
               (level ? " is no level: only -200 to 50 dBm are, leave the cell empty where there is none"
                      : " is no register"),
           line);
      return true;
    }
    return false;
  }

  static const char* lacks(std::string_view cell) {
    return says_nothing(cell) ? " missing" : " is no number";
  }

  void take_row(const std::vector<std::string_view>& cells, std::size_t line,
                const std::vector<float>* taps) {
    values_.clear();
    for (const auto cell : cells) values_.push_back(number_or_nan(cell, decimal_comma_));
    if (const auto at = header_.first(k_time); at != k_no_column && times_.size() < k_times_looked_at)
      times_.push_back(values_[at]);
    if (drop_impossible(line)) return;
    const auto value = [&](const Names& names) {
      const auto at = level_columns_.at(&names);
      return at == k_no_column ? std::nullopt : finite(values_[at]);
    };
    // A set without ranges can still tell classes by levels.
    const double range = range_ == k_no_column ? 0 : in_metres(values_[range_], header_.names[range_]);
    if (range_ != k_no_column && !(range > 0))
      return drop(header_.names[range_] + (std::isnan(range) ? lacks(cells[range_]) : " not above zero"),
                  line);
    // A class needs no true range: whoever asks for a bias leaves rows without one out.
    std::optional<double> truth;
    if (truth_ != k_no_column && !says_nothing(cells[truth_])) {
      truth = finite(in_metres(values_[truth_], header_.names[truth_]));
      if (truth) ratios_.add(range, *truth);
      if (!truth) return drop(header_.names[truth_] + " is no number", line);
      if (!(*truth > 0) || *truth > 1e4) return drop(header_.names[truth_] + " impossible", line);
    }
    if (range > 1e4) return drop(header_.names[range_] + " above 10 km", line);
    if (range_ != k_no_column && truth && std::abs(range - *truth) > ml::k_most_bias_m)
      return drop(header_.names[range_] + " is more than 100 m off its true range", line);
    std::optional<bool> los;
    if (label_ != k_no_column && !(los = class_of(cells[label_], line))) return;
    if (los)
      if (const auto other = contradicting(cells, *los); !other.empty())
        return drop(other + " contradicts " + header_.names[label_], line);

    nlos::DiagnosticSample s;
    if (range_ != k_no_column) s.range_m = range;
    s.rx_dbm = value(k_rx);
    s.fp_dbm = value(k_fp);
    s.fp_amp1 = value(k_f1);
    s.fp_amp2 = value(k_f2);
    s.fp_amp3 = value(k_f3);
    s.cir_power = value(k_cir_power);
    s.preamble_count = value(k_count);
    s.std_noise = value(k_std_noise);
    s.max_noise = value(k_max_noise);
    s.fp_index = value(k_fp_index);
    s.height_difference_m = value(k_height);
    s.heading_deg = value(k_heading);
    // The receiver's own first path where the file tells it: found again in magnitudes it lies 2 ns beside.
    if (taps) {
      s.cir = nlos::cir_shape(*taps, s.fp_index);
      if (!s.cir) return drop("no first path in the CIR", line);
    }
    out_.features.push_back(nlos::compute_features(s));
    for (const auto c : raw_columns_) out_.raw.push_back(c == k_no_column ? k_nan : values_[c]);
    out_.range_m.push_back(range);
    out_.true_range_m.push_back(truth);
    out_.los.push_back(los);
    std::string group = out_.grouping == Grouping::file ? file_ : joined(cells, group_columns_);
    if (out_.grouping == Grouping::row && !placement_columns_.empty())
      group = joined(cells, placement_columns_);
    else if (out_.grouping == Grouping::row)
      group = std::to_string(out_.rows());
    out_.group.push_back(out_.grouping == Grouping::time_block ? 0 : groups_.of(group));
    out_.line.push_back(static_cast<std::uint32_t>(line));
    out_.file.push_back(static_cast<std::uint32_t>(out_.file_names.size() - 1));
    // Placements told apart by their true range: without one, a row is a placement of its own.
    const bool alone = placement_columns_.empty() || (placed_by_truth_ && !truth);
    const std::string own = alone ? "line " + std::to_string(line) : joined(cells, placement_columns_);
    out_.placement.push_back(
        placements_.of((several_files_ ? file_ + "/" : "") + (alone ? own : group + "/" + own)));
    if (out_.placement.back() == out_.placement_names.size()) out_.placement_names.push_back(own);
  }

  const TableOptions& options_;
  bool several_files_;
  bool decimal_comma_{false}, placed_by_truth_{false};
  std::string file_;
  Header header_{};
  std::size_t range_{k_no_column}, label_{k_no_column}, truth_{k_no_column};
  std::vector<std::size_t> group_columns_, placement_columns_, raw_columns_;
  std::map<const Names*, std::size_t> level_columns_;  ///< what features are computed from
  std::vector<double> values_, times_;
  std::vector<std::size_t> other_labels_;  ///< that say the class by their names too
  ClassReader classes_, beside_;
  std::string unreadable_class_{};  ///< the first
  Ratios ratios_{};
  std::optional<Error> fatal_{};
  Ids groups_, placements_;
  LabelledTable out_;
};

}  // namespace

Result<LabelledTable> read_labelled_tables(std::span<const std::filesystem::path> paths,
                                           const TableOptions& options) {
  if (paths.empty()) return make_error(Errc::invalid_argument, "no data file is given");
  std::optional<CirTable> cir;
  if (options.cir) {
    BOOST_OUTCOME_TRY(cir, read_cir(*options.cir));
  }
  TableReader reader{options, paths.size() > 1};
  for (const auto& path : paths) {
    BOOST_OUTCOME_TRY(reader.read(path, cir ? &*cir : nullptr));
  }
  return reader.finish();
}

}  // namespace anchord::api
