#include <libsvm/svm.h>

#include <algorithm>
#include <memory>

#include "core/ml/train.hpp"

namespace anchord::ml {
namespace {

void say_nothing(const char*) {}

struct FreeModel {
  void operator()(svm_model* model) const { svm_free_and_destroy_model(&model); }
};

int libsvm_kernel(Kernel kernel) {
  switch (kernel) {
    case Kernel::linear:
      return LINEAR;
    case Kernel::polynomial:
      return POLY;
    case Kernel::sigmoid:
      return SIGMOID;
    case Kernel::rbf:
      return RBF;
  }
  return RBF;
}

}  // namespace

Result<Svm> fit_svm(const TrainingRows& rows, const SvmOptions& options, bool classification,
                    const Execution& run) {
  if (run.cancelled()) return make_error(Errc::canceled, "cancelled");
  const std::size_t d = rows.d, n = std::min(rows.n(), std::max<std::size_t>(options.max_rows, 1));
  if (n == 0) return make_error(Errc::too_few_observations, "an SVM needs rows, got none");
  svm_set_print_string_function(&say_nothing);
  std::vector<svm_node> nodes(n * (d + 1));
  std::vector<svm_node*> starts(n);
  std::vector<double> y(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t row = (2 * i + 1) * rows.n() / (2 * n);  // evenly; itself where all are taken
    starts[i] = nodes.data() + i * (d + 1);
    for (std::size_t j = 0; j < d; ++j) starts[i][j] = {static_cast<int>(j) + 1, rows.x[row * d + j]};
    starts[i][d] = {-1, 0};
    y[i] = classification ? (rows.y[row] > 0.5 ? 1.0 : -1.0) : rows.y[row];
  }
  svm_problem problem{static_cast<int>(n), y.data(), starts.data()};
  svm_parameter parameter{};
  parameter.svm_type = classification ? C_SVC : EPSILON_SVR;
  parameter.kernel_type = libsvm_kernel(options.kernel);
  parameter.degree = options.degree;
  parameter.gamma = options.gamma;
  parameter.coef0 = options.coef0;
  parameter.cache_size = 100;
  parameter.eps = 1e-3;
  parameter.C = options.c;
  parameter.p = options.epsilon_m;
  parameter.shrinking = 1;
  if (const char* why = svm_check_parameter(&problem, &parameter))
    return make_error(Errc::invalid_argument, std::string{"SVM: "} + why);
  const std::unique_ptr<svm_model, FreeModel> fitted{svm_train(&problem, &parameter)};
  if (!fitted || (classification && fitted->nr_class != 2))
    return make_error(Errc::too_few_observations, "an SVM needs rows of both classes");

  Svm out{options.kernel, options.gamma, options.coef0, options.degree, d, {}, {}, fitted->rho[0]};
  for (int i = 0; i < fitted->l; ++i) {
    for (std::size_t j = 0; j < d; ++j) out.support.push_back(fitted->SV[i][j].value);
    out.alpha.push_back(fitted->sv_coef[0][i]);
  }
  // libsvm's positive side is the class it met first.
  if (classification && fitted->label[0] < 0) {
    for (double& a : out.alpha) a = -a;
    out.rho = -out.rho;
  }
  return out;
}

}  // namespace anchord::ml
