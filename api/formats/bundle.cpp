#include "api/formats/bundle.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "core/base/base64.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

using nlohmann::json;

constexpr std::size_t k_read_bytes = 64 * 1024;
constexpr std::size_t k_uuid_bytes = 16;

Error refused(std::string why) { return make_error(Errc::bad_frame, std::move(why)); }

void append_real(std::string& out, double value) {
  if (!std::isfinite(value)) {
    out += "null";
    return;
  }
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  const std::string_view written(text, static_cast<std::size_t>(end - text));
  out += written;
  // -0 without a point is an integer, and loses its sign.
  if (written.find_first_of(".e") == std::string_view::npos) out += ".0";
}

void append_cell(std::string& out, const BundleCell& cell, CellKind kind) {
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) {
    out += std::to_string(*whole);
  } else if (const auto* real = std::get_if<double>(&cell)) {
    append_real(out, *real);
  } else if (const auto* text = std::get_if<std::string>(&cell)) {
    if (kind == CellKind::id && text->size() == k_uuid_bytes) {
      Uuid id;
      std::memcpy(id.bytes.data(), text->data(), k_uuid_bytes);
      out += '"' + to_string(id) + '"';
    } else if (kind == CellKind::text) {
      append_json_text(out, *text);
    } else {
      out += '"' + base64(*text) + '"';
    }
  } else {
    out += "null";
  }
}

/// Nothing where the value is not of this kind.
std::optional<BundleCell> read_cell(const json& value, CellKind kind) {
  if (value.is_null()) return BundleCell{};
  switch (kind) {
    case CellKind::integer:
      if (!value.is_number_integer() || (value.is_number_unsigned() && value.get<std::uint64_t>() >> 63 != 0))
        return std::nullopt;
      return BundleCell{value.get<std::int64_t>()};
    case CellKind::real:
      if (!value.is_number()) return std::nullopt;
      return BundleCell{value.get<double>()};
    case CellKind::text:
      if (!value.is_string()) return std::nullopt;
      return BundleCell{value.get<std::string>()};
    case CellKind::bytes: {
      if (!value.is_string()) return std::nullopt;
      auto bytes = from_base64(value.get_ref<const std::string&>());
      if (!bytes) return std::nullopt;
      return BundleCell{*std::move(bytes)};
    }
    case CellKind::id: {
      if (!value.is_string()) return std::nullopt;
      const auto id = parse_uuid(value.get_ref<const std::string&>());
      if (!id) return std::nullopt;
      return BundleCell{std::string(reinterpret_cast<const char*>(id.value().bytes.data()), k_uuid_bytes)};
    }
  }
  return std::nullopt;
}

}  // namespace

std::string bundle_entry_name(const BundleTable& table) { return "tables/" + table.name + ".ndjson"; }

std::size_t bundle_width(const BundleTable& table, const BundleRow* first) {
  std::size_t n = table.columns.size();
  while (n > 0 && table.columns[n - 1].later &&
         (first == nullptr || std::holds_alternative<std::monostate>((*first)[n - 1])))
    --n;
  return n;
}

std::string bundle_header(const BundleTable& table, std::size_t n_columns) {
  std::string line = "[";
  for (std::size_t i = 0; i < n_columns; ++i) {
    if (i > 0) line += ',';
    append_json_text(line, table.columns[i].name);
  }
  return line + "]\n";
}

std::string bundle_line(const BundleTable& table, const BundleRow& row, std::size_t n_columns) {
  std::string line = "[";
  for (std::size_t i = 0; i < n_columns; ++i) {
    if (i > 0) line += ',';
    append_cell(line, row[i], table.columns[i].kind);
  }
  return line + "]\n";
}

Result<std::size_t> read_bundle_header(const BundleTable& table, std::string_view line) {
  const std::size_t least = bundle_width(table, nullptr);
  std::string wanted;
  for (std::size_t n = table.columns.size(); n + 1 > least; --n) {
    wanted = bundle_header(table, n);
    wanted.pop_back();
    if (line == wanted) return n;
  }
  return make_error(Errc::invalid_argument, bundle_entry_name(table) + " has other columns than " + wanted);
}

Result<BundleRow> read_bundle_line(const BundleTable& table, std::string_view line, std::size_t n_columns) {
  json value;
  if (const auto error = parse_json(line, value)) return make_error(Errc::invalid_argument, error->detail);
  if (!value.is_array() || value.size() != n_columns)
    return make_error(Errc::invalid_argument, "is not an array of " + std::to_string(n_columns) + " values");
  BundleRow row(table.columns.size());
  for (std::size_t i = 0; i < n_columns; ++i) {
    auto cell = read_cell(value[i], table.columns[i].kind);
    if (!cell)
      return make_error(Errc::invalid_argument,
                        table.columns[i].name + " is not a valid " +
                            std::string(k_cell_kind_words.word(table.columns[i].kind)));
    row[i] = *std::move(cell);
  }
  return row;
}

Result<ZipLines> ZipLines::open(const ZipReader& zip, std::string_view name) {
  BOOST_OUTCOME_TRY(auto stream, zip.stream(name));
  return ZipLines(std::move(stream), std::string(name));
}

Result<bool> ZipLines::next(std::string_view& line) {
  std::size_t looked = at_;
  for (;;) {
    if (const auto end = buffer_.find('\n', looked); end != std::string::npos) {
      line = std::string_view(buffer_).substr(at_, end - at_);
      at_ = end + 1;
      ++number_;
      return true;
    }
    if (ended_) {
      if (at_ < buffer_.size()) return refused(name_ + " ends in the middle of a line");
      return false;
    }
    buffer_.erase(0, at_);
    at_ = 0;
    looked = buffer_.size();
    if (looked > k_line_bytes)
      return refused(name_ + " line " + std::to_string(number_ + 1) + " has more than " +
                     std::to_string(k_line_bytes) + " bytes");
    buffer_.resize(looked + k_read_bytes);
    const auto n = stream_.read(std::span(buffer_).subspan(looked));
    if (!n) return n.error();
    buffer_.resize(looked + n.value());
    ended_ = n.value() == 0;
  }
}

}  // namespace anchord::api
