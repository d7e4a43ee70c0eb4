#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "api/kit/record_limits.hpp"
#include "core/types/bundle.hpp"

namespace anchord::api {

/// What is wrong with the rows of a table of a bundle that a database would take: what REST refuses of such a
/// record or measurement (its limits are those of record_limits and row_limits), and what no reader of this
/// server could read again. What a server stores passes: also what its devices send that REST does not take.
class RowCheck {
 public:
  explicit RowCheck(const BundleTable& table);
  /// Column and reason; empty: nothing. The row has as many cells as the table columns.
  std::string fault_of(const BundleRow& row) const;

 private:
  enum class Document { none, any, plan, outline, kept };
  struct Column {
    Document document{Document::none};
    std::size_t most_characters{};
    bool required{};  ///< text that is not blank
    std::optional<Bounds> real{};
    std::optional<WholeBounds> whole{};
  };
  std::string text_fault(const Column& column, const std::string& text) const;
  std::string cell_fault(const Column& column, const BundleCell& cell) const;
  std::string fix_fault(const BundleRow& row) const;
  std::string range_fault(const BundleRow& row) const;
  std::size_t at(const char* column) const;

  const BundleTable& table_;
  std::vector<Column> columns_;
  bool of_fixes_{}, of_ranges_{};
};

}  // namespace anchord::api
