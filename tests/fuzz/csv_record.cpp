// Separated cells: every record ends, and what was read is read again from its quoted form.
#include "api/formats/csv_record.hpp"

#include <cstdint>
#include <string>

#include "tests/fuzz/check.hpp"

namespace {

std::string quoted(const std::vector<std::string_view>& cells, char separator) {
  std::string out;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) out += separator;
    out += '"';
    for (const char c : cells[i]) {
      if (c == '"') out += c;
      out += c;
    }
    out += '"';
  }
  return out + '\n';
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  if (size == 0) return 0;
  const api::CsvForm form{"\t;,"[data[0] % 3], (data[0] & 4) != 0};
  std::string_view text(reinterpret_cast<const char*>(data + 1), size - 1);
  api::CsvRecord record(form), again(form);
  while (!text.empty()) {
    const auto before = text.size();
    if (!record.take(text)) return 0;
    fuzz::require(text.size() < before, "a record takes something off the text");
    const std::string written = quoted(record.cells(), form.separator);
    std::string_view rest = written;
    fuzz::require(again.take(rest).value() && rest.empty(), "a quoted record is one record");
    fuzz::require(again.cells() == record.cells(), "cells read back");
  }
  return 0;
}
