#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/learning/model_artifact.hpp"
#include "core/ml/plausible.hpp"
#include "core/nlos/features.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

constexpr double k_huge = 1e15, k_most_bias_m = ml::k_most_bias_m;
constexpr std::size_t k_max_nodes = 2'000'000, k_max_roots = 5'000, k_max_numbers = 8'000'000,
                      k_max_terms = 50'000;
constexpr int k_max_tree_depth = 64;

/// Walks the document; the first thing wrong is kept, and everything after it answers with defaults.
class Walk {
 public:
  std::string error;

  void fail(const std::string& at, const std::string& what) {
    if (error.empty()) error = (at.empty() ? "/" : at) + ": " + what;
  }
  bool ok() const { return error.empty(); }

  const Json& member(const Json& object, const std::string& at, const char* key) {
    static const Json k_null;
    const auto found = object.is_object() ? object.find(key) : object.end();
    if (!object.is_object() || found == object.end()) {
      fail(at + "/" + key, "missing");
      return k_null;
    }
    return *found;
  }
  double number(const Json& object, const std::string& at, const char* key, double low, double high) {
    return number_of(member(object, at, key), at + "/" + key, low, high);
  }
  double number_of(const Json& value, const std::string& at, double low, double high) {
    if (!value.is_number()) {
      fail(at, "not a number");
      return low;
    }
    const double v = value.get<double>();
    if (!std::isfinite(v) || v < low || v > high) {
      std::array<char, 120> text{};
      std::snprintf(text.data(), text.size(), "out of range: %g, may be %g to %g", v, low, high);
      fail(at, text.data());
      return low;
    }
    return v;
  }
  std::size_t count(const Json& object, const std::string& at, const char* key, std::size_t most) {
    const double v = number(object, at, key, 0, static_cast<double>(most));
    if (v != std::floor(v)) fail(at + "/" + key, "not a whole number");
    return static_cast<std::size_t>(v);
  }
  std::string text(const Json& object, const std::string& at, const char* key, std::size_t most = 4096) {
    const Json& v = member(object, at, key);
    if (!v.is_string() || v.get_ref<const std::string&>().size() > most) {
      fail(at + "/" + key, "not a text of at most " + std::to_string(most) + " bytes");
      return std::string{};
    }
    return v.get<std::string>();
  }
  std::vector<double> numbers(const Json& object, const std::string& at, const char* key, std::size_t least,
                              std::size_t most, double low = -k_huge, double high = k_huge) {
    const Json& v = member(object, at, key);
    const std::string here = at + "/" + key;
    std::vector<double> out;
    if (!v.is_array() || v.size() < least || v.size() > most) {
      fail(here, "not an array of a possible length");
      return out;
    }
    out.reserve(v.size());
    for (std::size_t i = 0; i < v.size() && ok(); ++i) {
      if (!v[i].is_number() || !std::isfinite(v[i].get<double>()) || v[i].get<double>() < low ||
          v[i].get<double>() > high)
        fail(here + "/" + std::to_string(i), "not a number in range");
      else
        out.push_back(v[i].get<double>());
    }
    return out;
  }
  template <class Int>
  std::vector<Int> indices(const Json& object, const std::string& at, const char* key, std::size_t least,
                           std::size_t most, double low, double high) {
    std::vector<Int> out;
    for (const double v : numbers(object, at, key, least, most, low, high)) {
      if (v != std::floor(v)) fail(at + "/" + key, "not whole numbers");
      out.push_back(static_cast<Int>(v));
    }
    return out;
  }
};

ml::Scaler scaler_of(Walk& w, const Json& parent, const std::string& at, std::size_t most) {
  const Json& j = w.member(parent, at, "scaler");
  const std::string here = at + "/scaler";
  ml::Scaler out;
  out.mean = w.numbers(j, here, "mean", 1, most);
  out.sd = w.numbers(j, here, "sd", out.mean.size(), out.mean.size(), 1e-12);
  out.clip = w.number(j, here, "clip", 0, 1e6);
  return out;
}

ml::Trees trees_of(Walk& w, const Json& j, const std::string& at, std::size_t d) {
  ml::Trees out;
  out.base = w.number(j, at, "base", -k_huge, k_huge);
  out.scale = w.number(j, at, "scale", -k_huge, k_huge);
  const auto feature =
      w.indices<std::int32_t>(j, at, "feature", 1, k_max_nodes, -1, static_cast<double>(d) - 1);
  const std::size_t n = feature.size();
  const auto left = w.indices<std::uint32_t>(j, at, "left", n, n, 0, static_cast<double>(k_max_nodes));
  const auto value = w.numbers(j, at, "value", n, n);
  out.roots = w.indices<std::uint32_t>(j, at, "roots", 1, k_max_roots, 0, static_cast<double>(n) - 1);
  if (!w.ok()) return out;
  // Children stand after their parent, so one pass finds the depth, and no walk can turn in a circle.
  std::vector<int> depth(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    out.nodes.push_back({feature[i], left[i], value[i]});
    if (feature[i] < 0) continue;
    if (left[i] <= i || left[i] + std::size_t{1} >= n) {
      w.fail(at + "/left/" + std::to_string(i), "child out of range");
      return out;
    }
    if (depth[i] >= k_max_tree_depth) {
      w.fail(at + "/left/" + std::to_string(i), "tree deeper than 64");
      return out;
    }
    for (const std::size_t child : {std::size_t{left[i]}, left[i] + std::size_t{1}})
      depth[child] = std::max(depth[child], depth[i] + 1);
  }
  return out;
}

ml::Svm svm_of(Walk& w, const Json& j, const std::string& at, std::size_t d) {
  ml::Svm out;
  const auto kernel = ml::k_kernel_words.find(w.text(j, at, "kernel"));
  if (!kernel) w.fail(at + "/kernel", "unknown");
  out.kernel = kernel.value_or(out.kernel);
  out.gamma = w.number(j, at, "gamma", 0, 1e6);
  out.coef0 = w.number(j, at, "coef0", -1e6, 1e6);
  out.degree = static_cast<int>(w.count(j, at, "degree", 16));
  out.dims = w.count(j, at, "dims", ml::k_max_features);
  if (out.dims != d) w.fail(at + "/dims", "not the number of features");
  out.rho = w.number(j, at, "rho", -k_huge, k_huge);
  out.alpha = w.numbers(j, at, "alpha", 0, 200'000);
  out.support = w.numbers(j, at, "support", out.alpha.size() * out.dims,
                          std::min(out.alpha.size() * out.dims, k_max_numbers));
  return out;
}

ml::Linear linear_of(Walk& w, const Json& j, const std::string& at, std::size_t d) {
  ml::Linear out;
  out.weights = w.numbers(j, at, "weights", 0, d);
  out.offset = w.number(j, at, "offset", -k_huge, k_huge);
  return out;
}

ml::Polynomial polynomial_of(Walk& w, const Json& j, const std::string& at, std::size_t d) {
  ml::Polynomial out;
  const Json& terms = w.member(j, at, "terms");
  if (!terms.is_array() || terms.size() > k_max_terms) {
    w.fail(at + "/terms", "not an array of a possible length");
    return out;
  }
  for (std::size_t i = 0; i < terms.size() && w.ok(); ++i) {
    const std::string term = at + "/terms/" + std::to_string(i);
    auto features =
        w.indices<std::uint16_t>(terms[i], term, "features", 0, 16, 0, static_cast<double>(d) - 1);
    out.terms.push_back({std::move(features), w.number(terms[i], term, "coefficient", -k_huge, k_huge)});
  }
  return out;
}

ml::Scorer scorer_of(Walk& w, const Json& parent, const std::string& at, std::size_t d) {
  const Json& j = w.member(parent, at, "scorer");
  const std::string here = at + "/scorer";
  const auto kind = ml::k_scorer_words.find(w.text(j, here, "kind"));
  if (!kind) {
    w.fail(here + "/kind", "unknown");
    return ml::Linear{};
  }
  switch (*kind) {
    case ml::ScorerKind::linear:
      return linear_of(w, j, here, d);
    case ml::ScorerKind::polynomial:
      return polynomial_of(w, j, here, d);
    case ml::ScorerKind::trees:
      return trees_of(w, j, here, d);
    case ml::ScorerKind::svm:
      return svm_of(w, j, here, d);
  }
  return ml::Linear{};
}

ml::Classifier classifier_of(Walk& w, const Json& j, std::size_t features) {
  const std::string at = "/classifier";
  ml::Classifier out;
  out.scaler = scaler_of(w, j, at, features);
  out.slope = w.number(j, at, "slope", 0, 1e6);
  out.offset = w.number(j, at, "offset", -1e6, 1e6);
  out.p_min = w.number(j, at, "p_min", 0, 0.5);
  out.p_max = w.number(j, at, "p_max", 0.5, 1);
  out.threshold = w.number(j, at, "threshold", 0, 1);
  const Json& members = w.member(j, at, "members");
  if (!members.is_array() || members.empty() || members.size() > 16)
    w.fail(at + "/members", "not an array of 1 to 16");
  for (std::size_t i = 0; w.ok() && i < members.size(); ++i) {
    const std::string here = at + "/members/" + std::to_string(i);
    ml::Classifier::Member member;
    const Json& share = w.member(members[i], here, "share");
    if (!share.is_boolean())
      w.fail(here + "/share", "not true or false");
    else
      member.share = share.get<bool>();
    member.slope = w.number(members[i], here, "slope", -1e6, 1e6);
    member.offset = w.number(members[i], here, "offset", -1e6, 1e6);
    member.scorer = scorer_of(w, members[i], here, out.scaler.mean.size());
    out.members.push_back(std::move(member));
  }
  return out;
}

ml::Regressor regressor_of(Walk& w, const Json& j, std::size_t features) {
  const std::string at = "/regressor";
  ml::Regressor out;
  out.scaler = scaler_of(w, j, at, features);
  out.scorer = scorer_of(w, j, at, out.scaler.mean.size());
  out.min_m = w.number(j, at, "min_m", -k_huge, k_huge);
  out.max_m = w.number(j, at, "max_m", out.min_m, k_huge);
  out.fallback_m = w.number(j, at, "fallback_m", -k_huge, k_huge);
  out.sigma_m = w.number(j, at, "sigma_m", 1e-6, 1e6);
  return out;
}

ml::BiasMixture mixture_of(Walk& w, const Json& j, std::size_t features) {
  const std::string at = "/mixture";
  const double last = static_cast<double>(features) - 1;
  ml::BiasMixture out;
  const Json& s = w.member(j, at, "shared");
  const std::string here = at + "/shared";
  out.shared.centre_m = w.number(s, here, "centre_m", -k_most_bias_m, k_most_bias_m);
  out.shared.kappa = w.number(s, here, "kappa", 0, 1);
  out.shared.features = w.indices<std::size_t>(s, here, "features", 0, features, 0, last);
  const std::size_t k = out.shared.features.size();
  out.shared.mean = w.numbers(s, here, "mean", k, k);
  out.shared.sd = w.numbers(s, here, "sd", k, k, 1e-12);
  out.shared.low = w.numbers(s, here, "low", k, k);
  out.shared.high = w.numbers(s, here, "high", k, k);
  for (std::size_t i = 0; w.ok() && i < k; ++i)
    if (out.shared.low[i] > out.shared.high[i]) w.fail(here + "/low", "above high");
  out.shared.weight = w.numbers(s, here, "weight", k, k);
  out.shared.offset_m = w.number(s, here, "offset_m", -k_most_bias_m, k_most_bias_m);
  out.m0_m = w.number(j, at, "m0_m", -k_most_bias_m, k_most_bias_m);
  out.s0_m = w.number(j, at, "s0_m", 1e-4, k_most_bias_m);
  out.m1_m = w.number(j, at, "m1_m", -k_most_bias_m, k_most_bias_m);
  out.s1_m = w.number(j, at, "s1_m", 1e-4, k_most_bias_m);
  out.log_tau = w.number(j, at, "log_tau", -20, 20);
  out.quantile = w.number(j, at, "quantile", 0.01, 0.99);
  out.gain = w.number(j, at, "gain", 0, 1);
  if (w.ok() && j.contains("seen")) {
    auto& seen = out.seen.emplace();
    seen.min_m = w.number(j["seen"], at + "/seen", "min_m", -k_huge, k_huge);
    seen.max_m = w.number(j["seen"], at + "/seen", "max_m", seen.min_m, k_huge);
  }
  const Json& tail = w.member(j, at, "tail");
  if (!tail.is_array() || tail.size() > 8) w.fail(at + "/tail", "not an array of at most 8");
  for (std::size_t i = 0; w.ok() && i < tail.size(); ++i) {
    const std::string term = at + "/tail/" + std::to_string(i);
    const std::size_t feature = w.count(tail[i], term, "feature", features - 1);
    out.tail.push_back({feature, w.number(tail[i], term, "mean", -k_huge, k_huge),
                        w.number(tail[i], term, "sd", 1e-12, k_huge),
                        w.number(tail[i], term, "weight", -10, 10)});
  }
  return out;
}

ml::ModelInfo info_of(Walk& w, const Json& root) {
  const std::string at = "/manifest";
  const Json& j = w.member(root, "", "manifest");
  ml::ModelInfo out;
  const auto task = ml::k_task_words.find(w.text(j, at, "task"));
  if (!task) w.fail(at + "/task", "unknown");
  out.task = task.value_or(ml::Task::nlos_id);
  out.method = w.text(j, at, "method");
  out.feature_set = w.text(j, at, "feature_set");
  const Json& features = w.member(j, at, "features");
  if (!features.is_array() || features.empty() || features.size() > ml::k_max_features)
    w.fail(at + "/features", "not an array of 1 to 64 names");
  for (std::size_t i = 0; w.ok() && i < features.size(); ++i) {
    if (!features[i].is_string() || features[i].get_ref<const std::string&>().size() > 128)
      w.fail(at + "/features/" + std::to_string(i), "not a name");
    else
      out.features.push_back(features[i].get<std::string>());
  }
  const Json& data = w.member(j, at, "data");
  out.data_digest = w.text(data, at + "/data", "digest", 128);
  out.rows = w.count(data, at + "/data", "rows", 1'000'000'000'000);
  out.placements = w.count(data, at + "/data", "placements", 1'000'000'000'000);
  out.groups = w.count(data, at + "/data", "groups", 1'000'000'000'000);
  const Json& split = w.member(j, at, "split");
  out.group_by = w.text(split, at + "/split", "group_by");
  out.folds = w.count(split, at + "/split", "folds", 1'000'000);
  const Json& seed = w.member(j, at, "seed");
  if (!seed.is_number_unsigned())
    w.fail(at + "/seed", "not a whole number");
  else
    out.seed = seed.get<std::uint64_t>();
  const Json& metrics = w.member(j, at, "metrics");
  if (!metrics.is_object() || metrics.size() > 200)
    w.fail(at + "/metrics", "not an object");
  else
    for (const auto& [name, value] : metrics.items())
      out.metrics.emplace_back(name, w.number_of(value, at + "/metrics/" + name, -k_huge, k_huge));
  out.code_version = w.text(j, at, "code_version");
  out.why = w.text(j, at, "why");
  if (w.ok() && j.contains("not_for_live")) out.not_for_live = w.text(j, at, "not_for_live");
  return out;
}

}  // namespace

Result<ml::Model> read_model_artifact(std::string_view text) {
  if (text.size() > k_max_artifact_bytes)
    return make_error(Errc::bad_frame, "the artifact is larger than 64 MiB");
  Json root;
  if (const auto wrong = parse_json(text, root))
    return make_error(Errc::bad_frame, "not a model artifact: " + wrong->code + " " + wrong->detail);
  Walk w;
  const auto format = w.text(root, "", "format");
  if (w.ok() && format != k_model_format)
    return make_error(Errc::unsupported,
                      "model format " + format + ", this program reads " + std::string{k_model_format});
  ml::Model model;
  model.info = info_of(w, root);
  const std::size_t features = model.info.features.size();
  for (const auto& name : model.info.features)
    if (w.ok() && !nlos::means_the_same(model.info.feature_set, name))
      return make_error(Errc::unsupported,
                        name + " of the feature set " + model.info.feature_set + ", this program computes " +
                            std::string{nlos::k_feature_set_version} + ": train the model again");
  if (w.ok() && root.contains("classifier"))
    model.classifier = classifier_of(w, root["classifier"], features);
  if (w.ok() && root.contains("regressor")) model.regressor = regressor_of(w, root["regressor"], features);
  if (w.ok() && root.contains("mixture")) model.mixture = mixture_of(w, root["mixture"], features);
  if (w.ok() && model.info.task == ml::Task::nlos_id && !model.classifier) w.fail("/classifier", "missing");
  if (w.ok() && model.info.task != ml::Task::nlos_id && !model.regressor &&
      !(model.mixture && model.classifier))
    w.fail("/regressor", "missing");
  if (w.ok() && model.mixture && !model.classifier)
    w.fail("/classifier", "missing, and the mixture needs it");
  if (!w.ok()) return make_error(Errc::bad_frame, w.error);
  return model;
}

}  // namespace anchord::api
