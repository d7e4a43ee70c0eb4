#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/ml/dataset.hpp"
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

  double range_m() const { return features.get(nlos::Feature::range_m).value_or(0); }
};

/// What splits never divide.
enum class Place : std::uint8_t { environment, campaign, setting };
std::string_view place_word(Place place);
std::optional<Place> place_of(std::string_view word);
std::string place_name(const DatasetRow& row, Place place);

/// Rows of a frozen data set.
struct DatasetTable {
  std::vector<DatasetRow> rows;

  /// The canonical text: RFC 4180, features in the order of nlos::Feature and only those any row has,
  /// shortest digits that give the same double back. Texts that begin like a formula get an apostrophe.
  std::string csv() const;
  /// errors: bad_frame (names the line), unsupported (another version of the features)
  static Result<DatasetTable> parse(std::string_view csv);
};

/// SHA-256 of the canonical text.
std::string dataset_digest(std::string_view csv);

/// What was asked of a table, ready for training. Rows that lack a feature, label or truth are left out and
/// counted in `dropped`; `source` gets the table's row of each row.
struct LearningRows {
  ml::Dataset data;
  std::vector<std::size_t> source;
  std::map<std::string, std::size_t> dropped;
  std::vector<std::string> held_out;  ///< names of the groups with test rows
};
struct LearningWish {
  std::vector<std::string> features{};  ///< empty: those (nearly) all rows have
  bool need_label{}, need_truth{};
  std::optional<bool> only_los{};
  Place group_by{Place::environment};
};
/// errors: not_found (feature), too_few_observations (nothing left)
Result<LearningRows> learning_rows(const DatasetTable& table, const LearningWish& wish);

}  // namespace anchord::api
