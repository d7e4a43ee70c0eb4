#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "api/wire/rows_json.hpp"

namespace anchord::api {

/// Reads rows that are as they should be, fast: from the text straight into the row, no document between.
/// Whatever is not (a broken or unknown field, an escape in a text, a key twice) is left to parse_json() and
/// read_range() or read_fix(), which name what is wrong; a row read here is the row they read. One thread at
/// a time.
class RowParser {
 public:
  RowParser();
  ~RowParser();
  /// Nothing: left to the others.
  std::optional<RangeRow> range(std::string_view text, const std::optional<MissionId>& mission);
  std::optional<Fix> fix(std::string_view text, const std::optional<MissionId>& mission);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::api
