#include "api/measurements/row_source.hpp"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "api/formats/csv_record.hpp"
#include "api/kit/reader.hpp"
#include "core/base/text.hpp"

namespace anchord::api {

bool LineReader::fill() {
  constexpr std::size_t buffer_bytes = 64 * 1024;
  if (!buffer_) buffer_ = std::make_unique_for_overwrite<char[]>(buffer_bytes);
  at_ = 0;
  end_ = body_.read({buffer_.get(), buffer_bytes});
  if (end_ > left_bytes_) throw BodyError(413, "the body is larger than the limit of this address");
  left_bytes_ -= end_;
  return end_ > 0;
}

bool LineReader::next(std::string& line) {
  line.clear();
  too_long_ = false;
  bool any = false;
  while (at_ < end_ || fill()) {
    any = true;
    const char* begin = buffer_.get() + at_;
    const void* found = std::memchr(begin, '\n', end_ - at_);
    const std::size_t n =
        found != nullptr ? static_cast<std::size_t>(static_cast<const char*>(found) - begin) : end_ - at_;
    if (line.size() + n > k_max_row_bytes)
      too_long_ = true;
    else if (!too_long_)
      line.append(begin, n);
    at_ += n + (found != nullptr ? 1 : 0);
    if (found != nullptr) break;
  }
  if (!line.empty() && line.back() == '\r') line.pop_back();
  return any;
}

std::optional<std::vector<std::string_view>> split_json_array(std::string_view text) {
  const auto space = [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  while (!text.empty() && space(text.front())) text.remove_prefix(1);
  while (!text.empty() && space(text.back())) text.remove_suffix(1);
  if (text.size() < 2 || text.front() != '[' || text.back() != ']') return std::nullopt;
  text = text.substr(1, text.size() - 2);
  std::vector<std::string_view> out;
  std::size_t begin = 0;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\')
        ++i;
      else if (c == '"')
        in_string = false;
      continue;
    }
    switch (c) {
      case '"':
        in_string = true;
        break;
      case '[':
      case '{':
        ++depth;
        break;
      case ']':
      case '}':
        if (--depth < 0) return std::nullopt;
        break;
      case ',':
        if (depth == 0) {
          out.push_back(text.substr(begin, i - begin));
          begin = i + 1;
        }
        break;
      default:
        break;
    }
  }
  if (in_string || depth != 0) return std::nullopt;
  const auto last = text.substr(begin);
  const bool blank = std::all_of(last.begin(), last.end(), space);
  if (!blank)
    out.push_back(last);
  else if (!out.empty())
    return std::nullopt;
  return out;
}

namespace {

const std::map<std::string, std::string, std::less<>>& columns(RowKind kind) {
  static const std::map<std::string, std::string, std::less<>> k_common{
      {"t_us", "/t_us"}, {"received_us", "/received_us"}, {"seq", "/seq"}, {"mission", "/mission"}};
  static const auto k_range = [] {
    auto map = k_common;
    for (const char* name : {"kind", "tag", "antenna", "anchor", "distance_m", "rss_dbm", "fp_dbm", "rx_dbm",
                             "std_noise", "heading_deg"}) {
      map.emplace(name, std::string("/") + name);
    }
    for (const char* name : {"n", "dt_ps", "first_path_idx", "rxpacc", "b64"})
      map.emplace(std::string("cir_") + name, std::string("/cir/") + name);
    for (const char* name : {"distance_m", "los", "campaign"})
      map.emplace(std::string("truth_") + name, std::string("/truth/") + name);
    return map;
  }();
  static const auto k_fix = [] {
    auto map = k_common;
    for (const char* name : {"lon", "lat", "h_m", "fix", "heading_deg", "correction_age_s", "satellites"})
      map.emplace(name, std::string("/") + name);
    const auto array = [&map](std::string to, std::vector<const char*> names) {
      for (std::size_t i = 0; i < names.size(); ++i) map.emplace(names[i], to + "/" + std::to_string(i));
    };
    array("/sigma_m", {"sigma_e_m", "sigma_n_m", "sigma_u_m"});
    array("/cov_enu_m2", {"cov_ee_m2", "cov_en_m2", "cov_eu_m2", "cov_nn_m2", "cov_nu_m2", "cov_uu_m2"});
    array("/local_m", {"x_m", "y_m", "z_m"});
    array("/q", {"qx", "qy", "qz", "qw"});
    return map;
  }();
  return kind == RowKind::range ? k_range : k_fix;
}

bool is_text(std::string_view pointer) {
  return pointer == "/mission" || pointer == "/tag" || pointer == "/anchor" || pointer == "/fix" ||
         pointer == "/kind" || pointer == "/cir/b64" || pointer == "/truth/campaign";
}

}  // namespace

CsvRows::CsvRows(RowKind kind, std::string_view header, std::vector<FieldError>& errors) {
  if (header.substr(0, 3) == "\xef\xbb\xbf") header.remove_prefix(3);  // spreadsheets write a byte order mark
  CsvRecord names;
  const auto read = names.read(header);
  if (!read || !is_utf8(header)) {
    errors.push_back({"", "malformed",
                      "the header is not a CSV line in UTF-8" + (read ? "" : ": " + read.error().message)});
    return;
  }
  for (const auto cell : names.cells()) {
    const std::string name(cell);
    const auto it = columns(kind).find(name);
    if (it == columns(kind).end()) {
      errors.push_back(
          {"/" + to_utf8(name, 60), "unknown_field", "there is no column '" + to_utf8(name, 60) + "' here"});
    } else if (std::find(pointers_.begin(), pointers_.end(), it->second) != pointers_.end()) {
      errors.push_back({"/" + name, "duplicate_key", "column '" + name + "' occurs twice"});
    } else {
      pointers_.push_back(it->second);
    }
  }
}

void CsvRows::row(std::string_view line, nlohmann::json& out, std::vector<FieldError>& errors) const {
  out = nlohmann::json::object();
  if (!is_utf8(line)) {
    errors.push_back({"", "bad_utf8", "the line is not UTF-8"});
    return;
  }
  CsvRecord record;
  const auto read = record.read(line);
  const auto& values = record.cells();
  if (!read || values.size() != pointers_.size()) {
    errors.push_back({"", "malformed",
                      read ? "has " + std::to_string(values.size()) + " cells, the header " +
                                 std::to_string(pointers_.size())
                           : read.error().message});
    return;
  }
  for (std::size_t i = 0; i < pointers_.size(); ++i) {
    const auto cell = values[i];
    if (cell.empty()) continue;
    nlohmann::json value;
    if (is_text(pointers_[i])) {
      value = cell;
    } else if (pointers_[i] == "/truth/los" && (cell == "1" || cell == "0")) {
      value = cell == "1";
    } else if (parse_json(cell, value)) {
      std::string lower;
      for (const char c : cell) lower += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      if (lower.find("nan") != std::string::npos || lower.find("inf") != std::string::npos) {
        errors.push_back({pointers_[i], "non_finite", "must be a finite number"});
        continue;
      }
      value = cell;  // the field's own check names the type it wants
    }
    out[nlohmann::json::json_pointer(pointers_[i])] = std::move(value);
  }
}

}  // namespace anchord::api
