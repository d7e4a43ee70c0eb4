#pragma once

#include "core/ml/train.hpp"

/// Fits by OpenCV ml (4.6 of Debian 12), read back into our own scorers: nothing but training needs OpenCV.
/// It computes in floats, takes no row weights and no stop: a fit runs to its end, or ends with the worker
/// process that runs it. Same input, same bytes.
namespace anchord::ml {

/// C-SVC or epsilon-SVR. On all rows up to options.max_rows.
/// errors  too_few_observations (no rows, one class), invalid_argument (settings OpenCV refuses),
/// no_convergence
Result<Svm> fit_svm_opencv(const TrainingRows& rows, const SvmOptions& options, bool classification);

/// Random forest of regression trees on the answers; of classes (0 and 1) each leaf has its share, which is
/// CART with the Gini criterion.
/// errors  too_few_observations, invalid_argument
Result<Trees> fit_forest_opencv(const TrainingRows& rows, const TreeOptions& options);

}  // namespace anchord::ml
