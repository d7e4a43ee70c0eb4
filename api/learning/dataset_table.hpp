#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/ml/dataset.hpp"
#include "core/ml/model.hpp"
#include "core/nlos/features.hpp"

namespace anchord::api {

/// One labelled measurement, or the mean of those of one setting, with every feature its radio allowed.
struct DatasetRow {
  std::string campaign, environment, setting;
  bool test{false};
  std::optional<bool> los{};
  std::optional<double> true_range_m{};
  std::size_t repeats{1};  ///< how many measurements it stands for
  nlos::FeatureVector features{};
  std::vector<double> registers{};        ///< of DatasetTable::registers; NaN where it has none
  std::optional<double> truth_sigma_m{};  ///< of true_range_m; absent: exact beside the radio

  double range_m() const { return features.get(nlos::Feature::range_m).value_or(0); }
};

/// The level of a row that is none (row_limits::k_dbm), by the name of its feature; empty: all are, or are
/// absent.
std::string_view impossible_level(const DatasetRow& row);

/// What splits never divide.
enum class Place : std::uint8_t { environment, campaign, setting };
inline constexpr auto k_place_words = enum_table<Place>(
    {{"environment", Place::environment}, {"campaign", Place::campaign}, {"setting", Place::setting}});
constexpr std::string_view place_word(Place place) { return k_place_words.word(place); }
/// A campaign under its other name.
inline constexpr std::string_view k_session = "session";
constexpr std::optional<Place> place_of(std::string_view word) {
  return word == k_session ? Place::campaign : k_place_words.find(word);
}
std::string place_name(const DatasetRow& row, Place place);

/// Rows of a frozen data set.
struct DatasetTable {
  std::vector<DatasetRow> rows;
  std::vector<std::string> registers{};                  ///< of register_columns(), in that order
  std::string feature_set{nlos::k_feature_set_version};  ///< a table of the version before stays what it was

  /// The canonical text: RFC 4180, features in the order of nlos::Feature and only those any row has, then
  /// the registers and truth_sigma_m where any row has it, shortest digits that give the same double back.
  /// Texts that begin like a formula get an apostrophe.
  std::string csv() const;
  /// errors: bad_frame (names the line), unsupported (another version of the features)
  static Result<DatasetTable> parse(std::string_view csv);
};

/// Registers as their radio gave them, which some public sets hold: trees like them, and train on them where
/// they are named. Live ranges do not have them.
const std::vector<std::string_view>& register_columns();

/// SHA-256 of the canonical text: what sha256sum says of the file.
std::string dataset_digest(std::string_view csv);

/// True where a text begins as the canonical one does.
bool is_dataset_csv(std::string_view text);

/// What was asked of a table, ready for training. Rows that lack a feature, label or truth are left out and
/// counted in `dropped`; `source` gets the table's row of each row.
struct LearningRows {
  ml::Dataset data;
  std::vector<std::size_t> source;
  std::map<std::string, std::size_t> dropped;
  std::vector<std::string> held_out;  ///< names of the groups with test rows
};
struct LearningWish {
  /// Empty: those (nearly) all rows have, and ranges of a flight can have.
  std::vector<std::string> features{};
  bool need_label{}, need_truth{};
  std::optional<bool> only_los{};
  Place group_by{Place::environment};
};
/// Why a model of these rows misleads on single ranges: some are means or medians, whose noise is less than a
/// range's. Empty where every row is one ranging.
std::string not_for_live(const DatasetTable& table);

/// What a task needs of the rows.
LearningWish wish_of(ml::Task task, const DatasetTable& table);
/// errors: not_found (feature), too_few_observations (nothing left)
Result<LearningRows> learning_rows(const DatasetTable& table, const LearningWish& wish);

}  // namespace anchord::api
