#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"

/// The client's half of the wire: what `anchord import` and `anchord replay` send, and how they read the
/// answers.
namespace anchord::api {

/// Body of POST /missions.
std::string mission_request_json(const Mission& mission);
void append_ndjson(std::string& body, const Range& row);
void append_ndjson(std::string& body, const Fix& row);

struct IngestAnswer {
  std::uint64_t accepted{}, duplicates{}, rejected{};
  std::string first_error;  ///< "line 412: zero_distance: ..." or empty
};
/// Of a 200, or of the 422 that says that not one row was taken.
/// errors  bad_frame when it is not the answer of an ingest
Result<IngestAnswer> parse_ingest_answer(std::string_view body);
/// "id" of a created resource.
Result<std::string> parse_created_id(std::string_view body);
/// A mission, its fixes (NDJSON) or a page of its ranges as the server gives them, for a replay.
/// errors  bad_frame, with the line
Result<Mission> parse_mission(std::string_view body);
Result<std::vector<Fix>> parse_fixes(std::string_view ndjson);
struct RangePage {
  std::vector<Range> rows;
  std::string next_cursor;  ///< empty: the last page
};
Result<RangePage> parse_range_page(std::string_view body);
/// "detail" and the first of "errors" of a problem answer; the body's beginning when it is none.
std::string problem_text(std::string_view body);

}  // namespace anchord::api
