#include "api/kit/reader.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/line_text.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

std::string short_json(const Json& value) {
  std::string text = to_wire(value);
  if (text.size() > 100) return {};
  return text;
}

std::string escape_pointer(std::string_view key) {
  std::string out;
  for (const char c : key) {
    if (c == '~')
      out += "~0";
    else if (c == '/')
      out += "~1";
    else
      out += c;
  }
  return out;
}

/// Builds the value while refusing what the library would let pass: depth, repeated keys.
class Builder final : public nlohmann::json_sax<Json> {
 public:
  explicit Builder(Json& root) : root_(root) {}
  std::optional<FieldError> failure;

  bool null() override { return put(Json(nullptr)); }
  bool boolean(bool value) override { return put(Json(value)); }
  bool number_integer(number_integer_t value) override { return put(Json(value)); }
  bool number_unsigned(number_unsigned_t value) override { return put(Json(value)); }
  bool number_float(number_float_t value, const string_t& text) override {
    if (!std::isfinite(value))
      return fail("non_finite", "'" + to_utf8(text, 40) + "' is not a finite number");
    return put(Json(value));
  }
  bool string(string_t& value) override { return put(Json(std::move(value))); }
  bool binary(binary_t&) override { return fail("malformed", "binary value"); }
  bool start_object(std::size_t) override { return open(Json::object()); }
  bool start_array(std::size_t) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    if (stack_.back()->contains(name))
      return fail("duplicate_key", "key '" + to_utf8(name, 60) + "' occurs twice in one object", name);
    keys_.back() = name;
    return true;
  }
  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception& error) override {
    if (error.id == 406) return fail("non_finite", "a number is too large for a double");
    return fail("malformed", "not JSON at byte " + std::to_string(position));
  }

 private:
  std::string path() const {
    std::string at;
    for (std::size_t i = 0; i < stack_.size(); ++i) {
      if (stack_[i]->is_array())
        at += '/' + std::to_string(stack_[i]->size());
      else if (!keys_[i].empty())
        at += '/' + escape_pointer(keys_[i]);
    }
    return at;
  }
  bool fail(std::string code, std::string detail, const std::string& key = {}) {
    std::string at = path();
    if (!key.empty()) {
      const auto slash = keys_.back().empty() ? std::string::npos : at.rfind('/');
      at = (slash == std::string::npos ? at : at.substr(0, slash)) + '/' + escape_pointer(key);
    }
    if (!failure) failure = FieldError{at, std::move(code), std::move(detail)};
    return false;
  }
  Json* attach(Json value) {
    if (stack_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    if (stack_.back()->is_array()) {
      stack_.back()->push_back(std::move(value));
      return &stack_.back()->back();
    }
    return &((*stack_.back())[keys_.back()] = std::move(value));
  }
  bool put(Json value) {
    attach(std::move(value));
    return true;
  }
  bool open(Json value) {
    if (stack_.size() >= static_cast<std::size_t>(k_max_json_depth)) {
      return fail("too_deep", "nested deeper than " + std::to_string(k_max_json_depth));
    }
    stack_.push_back(attach(std::move(value)));
    keys_.emplace_back();
    return true;
  }
  bool close() {
    stack_.pop_back();
    keys_.pop_back();
    return true;
  }

  Json& root_;
  std::vector<Json*> stack_;
  std::vector<std::string> keys_;
};

/// "NaN" and "Infinity" are not JSON; naming them beats "not JSON at byte 20".
bool mentions_non_finite(std::string_view text) {
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (in_string) {
      if (text[i] == '\\')
        ++i;
      else if (text[i] == '"')
        in_string = false;
      continue;
    }
    if (text[i] == '"') in_string = true;
    const auto rest = text.substr(i, 3);
    if (rest == "NaN" || rest == "nan" || rest == "Inf" || rest == "inf") return true;
  }
  return false;
}

}  // namespace

std::optional<FieldError> parse_json(std::string_view text, Json& out) {
  if (!is_utf8(text)) return FieldError{"", "bad_utf8", "the text is not UTF-8"};
  Builder builder(out);
  if (Json::sax_parse(text.begin(), text.end(), &builder)) return std::nullopt;
  if (builder.failure && builder.failure->code == "malformed" && mentions_non_finite(text)) {
    return FieldError{builder.failure->pointer, "non_finite",
                      "NaN and Infinity are not allowed; leave unknown values out"};
  }
  return builder.failure ? builder.failure : FieldError{"", "malformed", "not JSON"};
}

Fields::Fields(const Json& value, std::string base, std::vector<FieldError>& errors)
    : object_(value.is_object() ? &value : nullptr), base_(std::move(base)), errors_(errors) {
  if (object_ == nullptr) errors_.push_back({base_, "wrong_type", "must be an object", short_json(value)});
}

std::string Fields::pointer(std::string_view key) const {
  return key.empty() ? base_ : base_ + '/' + escape_pointer(key);
}

bool Fields::has(std::string_view key) const {
  if (object_ == nullptr) return false;
  const auto it = object_->find(key);
  return it != object_->end() && !it->is_null();
}

const Json* Fields::child(std::string_view key) {
  known_.emplace(key);
  if (object_ == nullptr) return nullptr;
  const auto it = object_->find(key);
  return it == object_->end() || it->is_null() ? nullptr : &*it;
}

std::optional<double> Fields::finite(const Json& value, const std::string& at, double min, double max) {
  if (!value.is_number()) {
    errors_.push_back({at, "wrong_type", "must be a number", short_json(value)});
    return std::nullopt;
  }
  const double number = value.get<double>();
  if (!std::isfinite(number)) {
    errors_.push_back({at, "non_finite", "must be a finite number"});
    return std::nullopt;
  }
  if (number < min || number > max) {
    const auto bound = [](double x) { return to_wire(Json(x)); };
    errors_.push_back({at, "out_of_range", "must be " + bound(min) + ".." + bound(max), short_json(value)});
    return std::nullopt;
  }
  return number + 0.0;  // a zero has no sign
}

std::optional<double> Fields::number(std::string_view key, double min, double max, bool required) {
  const Json* value = child(key);
  if (value == nullptr) {
    if (required) error(key, "required", std::string(key) + " is missing");
    return std::nullopt;
  }
  return finite(*value, pointer(key), min, max);
}

std::optional<std::int64_t> Fields::integer(std::string_view key, std::int64_t min, std::int64_t max,
                                            bool required) {
  const Json* value = child(key);
  if (value == nullptr) {
    if (required) error(key, "required", std::string(key) + " is missing");
    return std::nullopt;
  }
  if (!value->is_number_integer()) {
    errors_.push_back({pointer(key), "wrong_type", "must be an integer", short_json(*value)});
    return std::nullopt;
  }
  const bool huge =
      value->is_number_unsigned() && value->get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX);
  const std::int64_t number = huge ? INT64_MAX : value->get<std::int64_t>();
  if (huge || number < min || number > max) {
    errors_.push_back({pointer(key), "out_of_range",
                       "must be " + std::to_string(min) + ".." + std::to_string(max), short_json(*value)});
    return std::nullopt;
  }
  return number;
}

std::optional<std::string> Fields::text(std::string_view key, std::size_t max_characters, bool required) {
  const Json* value = child(key);
  if (value == nullptr) {
    if (required) error(key, "required", std::string(key) + " is missing");
    return std::nullopt;
  }
  if (!value->is_string()) {
    errors_.push_back({pointer(key), "wrong_type", "must be a string", short_json(*value)});
    return std::nullopt;
  }
  const auto& text = value->get_ref<const std::string&>();
  if (required && is_blank(text)) {
    error(key, "out_of_range", "must not be empty");
    return std::nullopt;
  }
  if (const auto fault = line_fault(text, max_characters); fault != LineFault::none) {
    error(key, fault == LineFault::too_long ? "out_of_range" : "control_character",
          in_words(fault, max_characters));
    return std::nullopt;
  }
  return text;
}

std::optional<bool> Fields::boolean(std::string_view key) {
  const Json* value = child(key);
  if (value == nullptr) return std::nullopt;
  if (!value->is_boolean()) {
    errors_.push_back({pointer(key), "wrong_type", "must be true or false", short_json(*value)});
    return std::nullopt;
  }
  return value->get<bool>();
}

std::optional<std::vector<double>> Fields::numbers(std::string_view key, std::size_t n, double min,
                                                   double max, bool required) {
  const Json* value = child(key);
  if (value == nullptr) {
    if (required) error(key, "required", std::string(key) + " is missing");
    return std::nullopt;
  }
  if (!value->is_array() || value->size() != n) {
    errors_.push_back({pointer(key), "wrong_type", "must be an array of " + std::to_string(n) + " numbers",
                       short_json(*value)});
    return std::nullopt;
  }
  std::vector<double> out;
  for (std::size_t i = 0; i < n; ++i) {
    const auto number = finite((*value)[i], pointer(key) + '/' + std::to_string(i), min, max);
    if (number) out.push_back(*number);
  }
  if (out.size() != n) return std::nullopt;
  return out;
}

const std::string* Fields::one_of(std::string_view key, std::span<const std::string_view> words,
                                  bool required) {
  const Json* value = child(key);
  if (value == nullptr) {
    if (required) error(key, "required", std::string(key) + " is missing");
    return nullptr;
  }
  if (value->is_string() && std::ranges::find(words, value->get_ref<const std::string&>()) != words.end())
    return &value->get_ref<const std::string&>();
  errors_.push_back({pointer(key), "unknown_value", "must be one of " + list_of(words), short_json(*value)});
  return nullptr;
}

void Fields::must_be_named(std::string_view key) {
  if (object_ != nullptr && !object_->contains(key))
    error(key, "required", "must be a number, or null for no limit");
}

void Fields::error(std::string_view key, std::string code, std::string detail) {
  errors_.push_back({pointer(key), std::move(code), std::move(detail)});
}

void Fields::finish() {
  if (object_ == nullptr) return;
  for (const auto& [key, value] : object_->items()) {
    if (known_.find(key) == known_.end()) {
      errors_.push_back({pointer(key), "unknown_field", "there is no field '" + to_utf8(key, 60) + "' here"});
    }
  }
}

std::string media_type(const Request& request) {
  std::string type(request.header("content-type"));
  type = type.substr(0, type.find(';'));
  while (!type.empty() && type.back() == ' ') type.pop_back();
  for (char& c : type) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c);
  return type;
}

Json json_body(const Request& request, bool may_be_empty) {
  if (request.body.empty() && may_be_empty) return Json::object();
  const std::string type = media_type(request);
  if (type != "application/json" && type != "application/merge-patch+json") {
    throw_problem(415, "media-type", "send the header Content-Type: application/json");
  }
  const auto encoding = request.header("content-encoding");
  if (!encoding.empty() && encoding != "identity")
    throw_problem(415, "media-type", "compressed bodies are not accepted");
  Json body;
  if (auto error = parse_json(request.body, body)) {
    const bool syntax = error->code == "malformed" || error->code == "bad_utf8";
    throw_problem(syntax ? 400 : 422, syntax ? "malformed" : "validation", error->detail, {*error});
  }
  return body;
}

nlohmann::ordered_json kept_json(std::string_view text) {
  auto json = nlohmann::ordered_json::parse(text, nullptr, false);
  return json.is_discarded() ? nlohmann::ordered_json(nullptr) : json;
}

const std::string& text_body(const Request& request) {
  if (!is_utf8(request.body)) {
    throw_problem(400, "malformed", "the file is not UTF-8: save it as UTF-8 and send it again",
                  {{"", "bad_utf8", "the text is not UTF-8"}});
  }
  return request.body;
}

void refuse_if_any(const std::vector<FieldError>& errors) {
  if (errors.empty()) return;
  throw_problem(
      422, "validation",
      std::to_string(errors.size()) + (errors.size() == 1 ? " field is wrong" : " fields are wrong"), errors);
}

}  // namespace anchord::api
