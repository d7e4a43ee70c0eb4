#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/kit/message.hpp"
#include "api/kit/problem.hpp"

namespace anchord::api {

/// Longest single row (a range with a CIR has about 5 kB).
inline constexpr std::size_t k_max_row_bytes = 1 << 20;

/// Lines of a streamed body; memory is one buffer and one line. Ends are LF or CRLF.
class LineReader {
 public:
  LineReader(BodyReader& body, std::uint64_t limit_bytes) : body_(body), left_bytes_(limit_bytes) {}
  /// False at the end. A line beyond k_max_row_bytes is skipped whole and reported by too_long().
  /// Throws BodyError(413) when the body exceeds its limit.
  bool next(std::string& line);
  bool too_long() const { return too_long_; }

 private:
  bool fill();
  BodyReader& body_;
  std::uint64_t left_bytes_;
  std::unique_ptr<char[]> buffer_;  ///< none yet: nothing was read
  std::size_t at_{0}, end_{0};
  bool too_long_{false};
};

/// Cuts the elements out of a JSON array without parsing them. Null when the text is not one well-bracketed
/// array.
std::optional<std::vector<std::string_view>> split_json_array(std::string_view text);

enum class RowKind : std::uint8_t { range, fix };

/// Turns CSV rows (RFC 4180 quoting, one record a line, header first) into the JSON objects of the same rows.
/// Columns carry the names of the JSON fields; arrays and objects are flat: sigma_e_m sigma_n_m sigma_u_m,
/// x_m y_m z_m, qx qy qz qw, truth_distance_m, truth_los, cir_n cir_b64 and so on. An empty cell is an absent
/// field.
class CsvRows {
 public:
  /// errors: what is wrong with the header (unknown or repeated columns).
  CsvRows(RowKind kind, std::string_view header, std::vector<FieldError>& errors);
  void row(std::string_view line, nlohmann::json& out, std::vector<FieldError>& errors) const;

 private:
  std::vector<std::string> pointers_;  ///< per column: RFC 6901
};

}  // namespace anchord::api
