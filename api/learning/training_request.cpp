#include "api/learning/training_request.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

/// A session is a campaign under its other name.
std::optional<Place> read_group_by(Fields& fields) {
  std::vector<std::string_view> words(k_place_words.words().begin(), k_place_words.words().end());
  words.push_back(k_session);
  const auto word = fields.word("group_by", words);
  return word ? place_of(*word) : std::nullopt;
}

using Json = nlohmann::json;

constexpr std::array<std::string_view, 1> k_metrics{"fpr"};

std::vector<std::string> read_words(Fields& fields, const char* key, std::size_t most,
                                    std::vector<FieldError>& errors) {
  std::vector<std::string> out;
  const Json* list = fields.child(key);
  if (list == nullptr) return out;
  if (!list->is_array() || list->empty() || list->size() > most) {
    fields.error(key, "wrong_type", "must be an array of 1 to " + std::to_string(most) + " words");
    return out;
  }
  for (std::size_t i = 0; i < list->size(); ++i) {
    if ((*list)[i].is_string() && (*list)[i].get_ref<const std::string&>().size() <= 100)
      out.push_back((*list)[i].get<std::string>());
    else
      errors.push_back({fields.pointer(key) + "/" + std::to_string(i), "wrong_type", "must be a word"});
  }
  return out;
}

std::string methods_for(ml::Task task) {
  std::string out = "auto";
  for (const auto& [word, method] : ml::k_method_words)
    if (ml::suits(method, task)) out += ", " + std::string(word);
  return out;
}

/// {"svm": {"c": [1, 10], "gamma": [0.1]}}, or true for the declared grid of each method.
void read_grid(const Json& grid, ml::TrainingSpec& spec, std::vector<FieldError>& errors) {
  if (grid.is_boolean()) {
    spec.search = grid.get<bool>();
    return;
  }
  if (!grid.is_object()) {
    errors.push_back({"/grid", "wrong_type", "must be true, false or an object of methods"});
    return;
  }
  for (const auto& [name, axes] : grid.items()) {
    const std::string at = "/grid/" + to_utf8(name, 60);
    const auto method = ml::method_of(name);
    if (!method || !axes.is_object()) {
      errors.push_back({at, "unknown_value", "must be a method with an object of settings"});
      continue;
    }
    const auto known = ml::grid_settings(*method);
    for (const auto& [setting, values] : axes.items()) {
      const std::string here = at + "/" + to_utf8(setting, 60);
      if (std::find(known.begin(), known.end(), setting) == known.end()) {
        std::string all;
        for (const auto& word : known) all += (all.empty() ? "" : ", ") + word;
        errors.push_back({here, "unknown_field", "the settings of " + name + " are " + all});
      } else if (!values.is_array() || values.empty() || values.size() > 100 ||
                 !std::all_of(values.begin(), values.end(), [](const Json& v) { return v.is_number(); })) {
        errors.push_back({here, "wrong_type", "must be an array of 1 to 100 numbers"});
      } else {
        spec.grid[*method][setting] = values.get<std::vector<double>>();
      }
    }
  }
}

}  // namespace

TrainingRequest read_training_request(const Json& body, std::vector<FieldError>& errors) {
  TrainingRequest out;
  auto& spec = out.spec;
  Fields fields(body, "", errors);
  (void)fields.child("dataset");
  spec.task = fields.word("task", ml::k_task_words, true).value_or(spec.task);
  const auto methods = read_words(fields, "methods", 20, errors);
  for (std::size_t i = 0; i < methods.size(); ++i) {
    if (methods[i] == "auto" && methods.size() == 1) continue;
    const std::string at = "/methods/" + std::to_string(i);
    const auto method = ml::method_of(methods[i]);
    if (!method) {
      errors.push_back(
          {at, "unknown_value", "there is no such method; the methods are " + methods_for(spec.task)});
    } else if (!ml::suits(*method, spec.task)) {
      errors.push_back({at, "unsuitable",
                        methods[i] + " cannot learn " + std::string(ml::task_name(spec.task)) +
                            "; the methods that can are " + methods_for(spec.task)});
    } else {
      spec.methods.push_back(*method);
    }
  }
  spec.engine = fields.word("engine", ml::k_engine_words).value_or(spec.engine);
  for (std::size_t i = 0; i < spec.methods.size() && methods.size() == spec.methods.size(); ++i) {
    if (!ml::fits(spec.engine, spec.methods[i]))
      errors.push_back({"/methods/" + std::to_string(i), "unsuitable",
                        "engine opencv fits svm and random_forest, not " + methods[i]});
  }
  spec.features = read_words(fields, "features", ml::k_max_features, errors);
  for (std::size_t i = 0; i < spec.features.size(); ++i) {
    const auto& registers = register_columns();
    if (!nlos::feature_of(spec.features[i]) &&
        std::find(registers.begin(), registers.end(), spec.features[i]) == registers.end())
      errors.push_back({"/features/" + std::to_string(i), "unknown_value", "there is no such feature"});
  }
  if (const Json* cv = fields.child("cv")) {
    Fields inner(*cv, "/cv", errors);
    spec.folds = static_cast<std::size_t>(
        inner.integer("folds", 2, 100).value_or(static_cast<std::int64_t>(spec.folds)));
    spec.seed = static_cast<std::uint64_t>(
        inner.integer("seed", 0, 1'000'000'000).value_or(static_cast<std::int64_t>(spec.seed)));
    out.group_by = read_group_by(inner).value_or(out.group_by);
    inner.finish();
  }
  if (const Json* grid = fields.child("grid")) read_grid(*grid, spec, errors);
  if (const Json* select = fields.child("select")) {
    Fields inner(*select, "/select", errors);
    (void)inner.word("metric", k_metrics, true);
    spec.max_fpr = inner.number("max", 0, 1, true);
    inner.finish();
  }
  spec.importance = fields.boolean("importance").value_or(true);
  spec.selection = fields.boolean("selection").value_or(false);
  spec.per_placement = static_cast<std::size_t>(
      fields.integer("per_placement", 1, 100'000).value_or(static_cast<std::int64_t>(spec.per_placement)));
  fields.finish();
  const auto judged = spec.check();
  if (!judged && errors.empty()) errors.push_back({"", "out_of_range", judged.error().message});
  return out;
}

}  // namespace anchord::api
