#pragma once

#include <string>
#include <vector>

#include "api/formats/labelled_table.hpp"
#include "core/ml/evaluate.hpp"
#include "core/ml/training.hpp"

/// What `anchord train` and `anchord evaluate` print: JSON for programs, a table for people. docs/learning.md
/// lists the fields.
namespace anchord::api {

/// Rows read, used, and why the others were not.
struct RowReport {
  std::vector<std::string> files{};
  std::size_t read{}, used{};
  std::map<std::string, std::pair<std::size_t, std::string>>
      dropped{};  ///< reason -> how many, first place ("" where unknown)
  std::string label{}, truth{}, group_by{}, placement{};
  std::string warning{};                ///< an optimistic split, for one
  std::vector<std::string> unused{};    ///< columns that nothing was taken from
  std::vector<std::string> warnings{};  ///< what is odd about the table
  std::string los_value{};              ///< of the label column: what was taken for LOS
};

std::string train_json(const ml::TrainingOutcome& outcome, const RowReport& rows,
                       const std::string& out_path);
std::string train_text(const ml::TrainingOutcome& outcome, const RowReport& rows,
                       const std::string& out_path);
std::string evaluation_json(const ml::Evaluation& evaluation, const ml::Model& model, const RowReport& rows);
std::string evaluation_text(const ml::Evaluation& evaluation, const ml::Model& model, const RowReport& rows);

}  // namespace anchord::api
