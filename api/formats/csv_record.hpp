#pragma once

#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::api {

struct CsvForm {
  char separator{','};
  bool trims{true};  ///< blanks and tabs round a cell are no part of it; those inside its quotes are
};

/// Cells of CSV records, RFC 4180: a cell that begins with a double quote ends at the next one and may have
/// separators, line ends and, doubled, quotes in it. Lines end in LF or CR LF. Whatever reads separated cells
/// reads them here.
class CsvRecord {
 public:
  explicit CsvRecord(CsvForm form = {}) : form_(form) {}

  /// Takes the first record off `text`; false where nothing is left.
  /// errors  bad_frame: a quote that is not closed, or text behind a closing quote
  Result<bool> take(std::string_view& text);
  /// A whole line as one record. errors: those of take()
  Result<void> read(std::string_view line);

  /// Of the newest record. They live as long as its text and until the next call.
  const std::vector<std::string_view>& cells() const { return cells_; }

 private:
  Result<std::string_view> quoted(std::string_view& text);
  bool blank(char c) const { return form_.trims && (c == ' ' || c == '\t') && c != form_.separator; }

  CsvForm form_;
  std::vector<std::string_view> cells_;
  std::deque<std::string> unescaped_;  ///< a deque: views into it stay
};

}  // namespace anchord::api
