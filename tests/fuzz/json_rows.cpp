// Lines of a bulk upload: every line is judged, none may crash, what is accepted keeps the stated limits.
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

#include "api/kit/reader.hpp"
#include "api/wire/row_parser.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/base64.hpp"
#include "core/base/to_wire.hpp"
#include "tests/fuzz/check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  static api::RowParser parser;
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  while (!rest.empty()) {
    const std::size_t end = rest.find('\n');
    const std::string_view line = rest.substr(0, end);
    rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
    // What is read straight is what is read through a document.
    const auto straight = parser.range(line, std::nullopt);
    const auto straight_fix = parser.fix(line, std::nullopt);
    nlohmann::json row;
    if (api::parse_json(line, row)) {
      fuzz::require(!straight && !straight_fix, "only JSON is taken");
      continue;
    }
    std::vector<api::FieldError> errors;
    const auto range = api::read_range(row, std::nullopt, errors);
    fuzz::require(!straight || errors.empty(), "only what has no error is taken");
    if (errors.empty()) {
      fuzz::require(!straight || to_wire(api::range_json(straight->range, 1)) ==
                                     to_wire(api::range_json(range.range, 1)),
                    "one row for both readers");
      fuzz::require(range.range.distance_m >= 0.05 && range.range.distance_m <= 150,
                    "a range is 0.05 to 150 m");
      (void)to_wire(api::range_json(range.range, 1));
    }
    errors.clear();
    const Fix fix = api::read_fix(row, std::nullopt, errors);
    fuzz::require(!straight_fix || errors.empty(), "only what has no error is taken");
    if (errors.empty()) {
      fuzz::require(std::isfinite(fix.position.lat_deg) && std::abs(fix.position.lat_deg) <= 90,
                    "latitude in bounds");
      (void)to_wire(api::fix_json(fix, std::nullopt));
    }
  }
  (void)from_base64(std::string_view(reinterpret_cast<const char*>(data), size));
  return 0;
}
