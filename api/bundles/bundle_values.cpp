#include "api/bundles/bundle_values.hpp"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "api/kit/reader.hpp"
#include "api/planning/plan_json.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

std::string in_words(const FieldError& error) {
  return (error.pointer.empty() ? "" : error.pointer + ": ") + error.detail;
}

/// Empty documents are there where nothing was to be said.
std::string document_fault(const std::string& text, bool plan) {
  if (text.empty() && !plan) return {};
  Json document;
  if (const auto wrong = parse_json(text, document)) return "is not JSON that can be read: " + wrong->detail;
  if (!document.is_structured()) return "is neither an object nor an array";
  if (!plan) return {};
  std::vector<FieldError> errors;
  (void)read_plan(document, errors);
  return errors.empty() ? "" : "is no plan that this version can read: " + in_words(errors.front());
}

std::string text_fault(const std::string& column, const std::string& text, bool plan) {
  if (text.find('\0') != std::string::npos) return "has a character 0";
  if (column.ends_with("_json")) return document_fault(text, plan);
  return {};
}

struct Range {
  std::string_view column_end;
  double least, most;
};
/// As the requests have them that make such rows.
constexpr std::array k_ranges{Range{"lat_deg", -90, 90}, Range{"lon_deg", -180, 180}};

std::string number_fault(const std::string& column, double value) {
  for (const auto& range : k_ranges) {
    if (column.ends_with(range.column_end) && !(value >= range.least && value <= range.most))
      return "is not within " + std::to_string(static_cast<int>(range.least)) + " and " +
             std::to_string(static_cast<int>(range.most));
  }
  return std::isfinite(value) ? "" : "is not a number";
}

}  // namespace

std::string fault_of(const BundleTable& table, const BundleRow& row) {
  for (std::size_t i = 0; i < row.size() && i < table.columns.size(); ++i) {
    const auto& column = table.columns[i];
    std::string fault;
    if (const auto* number = std::get_if<double>(&row[i]))
      fault = number_fault(column.name, *number);
    else if (const auto* text = std::get_if<std::string>(&row[i]); text && column.kind == CellKind::text)
      fault = text_fault(column.name, *text, table.name == "plan");
    else if (const auto* whole = std::get_if<std::int64_t>(&row[i]);
             whole && column.name == "version" && *whole < 1)
      fault = "is not 1 or more";
    if (!fault.empty()) return column.name + ' ' + fault;
  }
  return {};
}

}  // namespace anchord::api
