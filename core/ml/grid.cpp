#include <algorithm>
#include <array>
#include <string_view>

#include "core/ml/learn.hpp"

namespace anchord::ml {
namespace {

// What a setting is called, which methods have it, and where it lives in a recipe.
struct Setting {
  std::string_view name;
  std::array<Method, 3> methods;
  double (*get)(const Recipe&);
  void (*set)(Recipe&, double);
};

int whole(double value) { return static_cast<int>(std::clamp(value, -1e6, 1e6)); }

constexpr std::array k_settings{
    Setting{"c",
            {Method::logistic, Method::average, Method::logistic},
            [](const Recipe& r) { return r.c; },
            [](Recipe& r, double v) {
              r.c = v;
              r.svm.c = std::min(v, 10.0);
            }},
    Setting{"c",
            {Method::svm, Method::svm, Method::svm},
            [](const Recipe& r) { return r.svm.c; },
            [](Recipe& r, double v) { r.svm.c = v; }},
    Setting{"kernel",
            {Method::svm, Method::svm, Method::svm},
            [](const Recipe& r) { return static_cast<double>(r.svm.kernel); },
            [](Recipe& r, double v) { r.svm.kernel = static_cast<Kernel>(std::clamp(whole(v), 0, 3)); }},
    Setting{"gamma",
            {Method::svm, Method::average, Method::svm},
            [](const Recipe& r) { return r.svm.gamma; },
            [](Recipe& r, double v) { r.svm.gamma = v; }},
    Setting{"coef0",
            {Method::svm, Method::svm, Method::svm},
            [](const Recipe& r) { return r.svm.coef0; },
            [](Recipe& r, double v) { r.svm.coef0 = v; }},
    Setting{"degree",
            {Method::svm, Method::svm, Method::svm},
            [](const Recipe& r) { return static_cast<double>(r.svm.degree); },
            [](Recipe& r, double v) { r.svm.degree = whole(v); }},
    Setting{"epsilon_m",
            {Method::svm, Method::svm, Method::svm},
            [](const Recipe& r) { return r.svm.epsilon_m; },
            [](Recipe& r, double v) { r.svm.epsilon_m = v; }},
    Setting{"trees",
            {Method::random_forest, Method::average, Method::tree_average},
            [](const Recipe& r) { return static_cast<double>(r.forest.trees); },
            [](Recipe& r, double v) { r.forest.trees = whole(v); }},
    Setting{"leaf_share",
            {Method::random_forest, Method::average, Method::tree_average},
            [](const Recipe& r) { return r.forest.leaf_share; },
            [](Recipe& r, double v) { r.forest.leaf_share = v; }},
    Setting{"max_depth",
            {Method::random_forest, Method::random_forest, Method::random_forest},
            [](const Recipe& r) { return static_cast<double>(r.forest.max_depth); },
            [](Recipe& r, double v) { r.forest.max_depth = whole(v); }},
    Setting{"features_per_split",
            {Method::random_forest, Method::random_forest, Method::random_forest},
            [](const Recipe& r) { return static_cast<double>(r.forest.features_per_split); },
            [](Recipe& r, double v) {
              r.forest.features_per_split = static_cast<std::size_t>(std::max(0, whole(v)));
            }},
    Setting{"rounds",
            {Method::boosted, Method::tree_average, Method::boosted},
            [](const Recipe& r) { return static_cast<double>(r.boosted.rounds); },
            [](Recipe& r, double v) { r.boosted.rounds = whole(v); }},
    Setting{"depth",
            {Method::boosted, Method::tree_average, Method::boosted},
            [](const Recipe& r) { return static_cast<double>(r.boosted.depth); },
            [](Recipe& r, double v) { r.boosted.depth = whole(v); }},
    Setting{"learning_rate",
            {Method::boosted, Method::tree_average, Method::boosted},
            [](const Recipe& r) { return r.boosted.learning_rate; },
            [](Recipe& r, double v) { r.boosted.learning_rate = v; }},
    Setting{"degree",
            {Method::univariate, Method::multivariate, Method::univariate},
            [](const Recipe& r) { return static_cast<double>(r.degree); },
            [](Recipe& r, double v) { r.degree = whole(v); }},
    Setting{"interactions",
            {Method::multivariate, Method::multivariate, Method::multivariate},
            [](const Recipe& r) { return r.interactions ? 1.0 : 0.0; },
            [](Recipe& r, double v) { r.interactions = v > 0.5; }},
    Setting{"ridge",
            {Method::multivariate, Method::univariate, Method::multivariate},
            [](const Recipe& r) { return r.ridge; },
            [](Recipe& r, double v) { r.ridge = v; }},
};

bool belongs(const Setting& setting, Method method) {
  return std::find(setting.methods.begin(), setting.methods.end(), method) != setting.methods.end();
}

}  // namespace

bool suits(Method method, Task task) {
  switch (method) {
    case Method::logistic:
    case Method::average:
    case Method::tree_average:
      return task == Task::nlos_id;
    case Method::none:
    case Method::constant:
    case Method::univariate:
    case Method::multivariate:
    case Method::least_absolute:
      return task != Task::nlos_id;
    case Method::random_forest:
    case Method::svm:
    case Method::boosted:
      return true;
  }
  return false;
}

std::vector<std::string> grid_settings(Method method) {
  std::vector<std::string> out;
  for (const auto& s : k_settings)
    if (belongs(s, method)) out.emplace_back(s.name);
  return out;
}

bool apply_setting(Recipe& recipe, std::string_view name, double value) {
  for (const auto& s : k_settings) {
    if (!belongs(s, recipe.method) || s.name != name) continue;
    s.set(recipe, value);
    return true;
  }
  return false;
}

std::vector<std::pair<std::string, double>> settings_of(const Recipe& recipe) {
  std::vector<std::pair<std::string, double>> out;
  for (const auto& s : k_settings)
    if (belongs(s, recipe.method)) out.emplace_back(s.name, s.get(recipe));
  return out;
}

std::map<std::string, std::vector<double>> default_grid(Method method, bool classification) {
  switch (method) {
    case Method::logistic:
      return {{"c", {0.1, 0.3, 1, 3, 10, 30}}};
    case Method::svm:
      if (classification) return {{"kernel", {0, 1, 2, 3}}, {"c", {1, 3, 10}}, {"gamma", {0.01, 0.03, 0.1}}};
      return {{"kernel", {0, 1, 2, 3}}, {"c", {0.3, 1, 3}}, {"gamma", {0.03, 0.1, 0.3}}};
    case Method::random_forest:
      return {{"trees", {60, 120}}, {"leaf_share", {0.01, 0.02, 0.04, 0.08}}, {"features_per_split", {0, 2}}};
    case Method::boosted:
    case Method::tree_average:
      return {{"rounds", {100, 300}}, {"depth", {2, 4, 6}}};
    case Method::average:
      return {{"c", {1, 3, 10}}, {"gamma", {0.01, 0.03, 0.1}}, {"leaf_share", {0.03, 0.08}}};
    case Method::univariate:
      return {{"degree", {1, 2, 3, 4, 5}}};
    case Method::multivariate:
      return {{"degree", {1, 2, 3}}, {"interactions", {0, 1}}, {"ridge", {1e-4, 1e-3, 1e-2}}};
    case Method::none:
    case Method::constant:
    case Method::least_absolute:
      return {};
  }
  return {};
}

std::vector<Recipe> expand(const Recipe& recipe, const std::map<std::string, std::vector<double>>& axes) {
  std::vector<Recipe> out{recipe};
  for (const auto& [name, values] : axes) {
    std::vector<Recipe> wider;
    for (const auto& one : out) {
      for (const double value : values) {
        wider.push_back(one);
        apply_setting(wider.back(), name, value);
      }
    }
    out = std::move(wider);
  }
  // A linear kernel has no gamma: one of its values stands for all.
  if (const auto gamma = axes.find("gamma"); gamma != axes.end() && recipe.method == Method::svm)
    std::erase_if(out, [&](const Recipe& one) {
      return one.svm.kernel == Kernel::linear && one.svm.gamma != gamma->second.front();
    });
  return out;
}

}  // namespace anchord::ml
