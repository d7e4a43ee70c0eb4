#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "server/cli/terminal_text.hpp"

/// Tables of plain text for a terminal. Pure; any thread.
namespace anchord::cli {

/// Columns of a terminal that UTF-8 text takes: 2 for the wide characters of East Asia and pictures, 0 for
/// combining marks. Close to what terminals do; who writes to one also turns its line wrap off.
std::size_t columns_of(std::string_view utf8);

/// At most `columns` of it, ending in "..." where something was cut off and there is room to say so.
std::string cut_to(std::string_view utf8, std::size_t columns);

struct Column {
  std::string title;  ///< with the unit
  bool is_number{};   ///< to the right
  bool may_shrink{};  ///< gives columns up when the line is too long
};

/// The titles and a line for each row, cells two spaces apart; every cell by one_line(). A row with fewer
/// cells than columns ends early. `width` in columns; 0: no limit.
std::vector<std::string> table_lines(const std::vector<Column>& columns,
                                     const std::vector<std::vector<std::string>>& rows, std::size_t width);

}  // namespace anchord::cli
