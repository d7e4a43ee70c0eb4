#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord::api {

/// A range as sent, with the pose some gateways attach (it becomes a fix of the same mission and instant).
struct RangeRow {
  Range range;
  std::optional<Fix> pose{};
};

/// Reads one range (api.md section 4). Everything wrong is appended to `errors`; the value is usable only
/// when nothing was appended. `mission`: of the query, used where the row names none. Limits: distance
/// 0.05..150 m, 0 is `zero_distance` (the failure value of Pozyx radios).
RangeRow read_range(const nlohmann::json& row, const std::optional<MissionId>& mission,
                    std::vector<FieldError>& errors);

/// Reads one fix. Position either lon, lat, h_m or local_m; |lat| <= 90, |lon| <= 180, height -500..9000 m,
/// longitude and latitude both 0 refused (`null_island`: what a receiver without a fix sends).
Fix read_fix(const nlohmann::json& row, const std::optional<MissionId>& mission,
             std::vector<FieldError>& errors);

nlohmann::ordered_json range_json(const Range& range, std::optional<std::int64_t> id);
nlohmann::ordered_json fix_json(const Fix& fix, std::optional<std::int64_t> id);
/// Their text without a document, byte for byte what to_wire makes of it: rows leave by the million.
/// rest  members that follow those of the range
void append_range(std::string& out, const Range& range, std::optional<std::int64_t> id, bool with_cir,
                  const nlohmann::ordered_json& rest);
void append_fix(std::string& out, const Fix& fix, std::optional<std::int64_t> id);
/// A number as to_wire writes it.
void append_number(std::string& out, double value);

/// {"n", "dt_ps", "first_path_idx", "rxpacc", "b64"}; what is wrong goes to `errors`, under `at`.
std::optional<Cir> read_cir(const nlohmann::json& value, const std::string& at,
                            std::vector<FieldError>& errors);
nlohmann::ordered_json cir_json(const Cir& cir);
/// int16 re, im, little endian.
std::string cir_bytes(const Cir& cir);

}  // namespace anchord::api
