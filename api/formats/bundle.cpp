#include "api/formats/bundle.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <set>

#include "api/kit/reader.hpp"
#include "core/base/base64.hpp"
#include "core/base/sha256.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using nlohmann::json;

constexpr std::string_view k_format = "anchord-bundle";
constexpr std::uint64_t k_manifest_bytes = 1 << 20;
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

/// A member of the manifest; empty or 0 where it is missing or of another kind, which no digest fits.
std::string text_of(const json& object, const char* key) {
  const auto at = object.is_object() ? object.find(key) : object.end();
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string{};
}
std::uint64_t count_of(const json& object, const char* key) {
  const auto at = object.is_object() ? object.find(key) : object.end();
  return at != object.end() && at->is_number_unsigned() ? at->get<std::uint64_t>() : 0;
}

}  // namespace

std::string bundle_digest(const BundleManifest& manifest) {
  Sha256 sum;
  sum.add(std::string(k_format) + ' ' + std::to_string(k_bundle_version) + ' ' + to_string(manifest.mission) +
          '\n');
  for (const auto& entry : manifest.entries) {
    if (!entry.name.starts_with(k_bundle_notes)) sum.add(entry.sha256_hex + "  " + entry.name + '\n');
  }
  return sum.hex();
}

std::string write_bundle_manifest(const BundleManifest& manifest) {
  nlohmann::ordered_json entries = nlohmann::ordered_json::array();
  for (const auto& entry : manifest.entries)
    entries.push_back(
        {{"name", entry.name}, {"bytes", entry.bytes}, {"rows", entry.rows}, {"sha256", entry.sha256_hex}});
  return to_wire(
             nlohmann::ordered_json{
                 {"format", k_format},
                 {"version", k_bundle_version},
                 {"mission", {{"id", to_string(manifest.mission)}, {"name", manifest.mission_name}}},
                 {"made_at", to_rfc3339(manifest.made)},
                 {"made_by", manifest.made_by},
                 {"digest", "sha256:" + bundle_digest(manifest)},
                 {"entries", std::move(entries)}},
             1) +
         '\n';
}

Result<BundleManifest> read_bundle_manifest(std::string_view text) {
  json root;
  if (const auto error = parse_json(text, root)) return refused("the manifest is not JSON: " + error->detail);
  if (text_of(root, "format") != k_format) return refused("the manifest is not that of a flight bundle");
  if (const auto version = count_of(root, "version"); version != k_bundle_version)
    return make_error(Errc::unsupported, "the bundle is of version " + std::to_string(version) +
                                             " of the format, this server reads " +
                                             std::to_string(k_bundle_version));
  BundleManifest out;
  const auto mission = root.find("mission");
  const auto id = parse_uuid(mission != root.end() ? text_of(*mission, "id") : std::string{});
  if (!id) return refused("the manifest gives no mission");
  out.mission = MissionId{id.value()};
  out.mission_name = text_of(*mission, "name");
  out.made_by = text_of(root, "made_by");
  const auto entries = root.find("entries");
  if (entries == root.end() || !entries->is_array()) return refused("the manifest has no entries");
  for (const auto& entry : *entries)
    out.entries.push_back({text_of(entry, "name"), count_of(entry, "bytes"), count_of(entry, "rows"),
                           text_of(entry, "sha256")});
  if (text_of(root, "digest") != "sha256:" + bundle_digest(out))
    return refused("the manifest was changed: its digest does not match its entries");
  return out;
}

Result<BundleManifest> checked_bundle(const ZipReader& zip) {
  if (!zip.has(k_bundle_manifest))
    return refused("this is not a valid flight bundle: it has no manifest.json");
  BOOST_OUTCOME_TRY(const std::string text, zip.text(k_bundle_manifest, k_manifest_bytes));
  BOOST_OUTCOME_TRY(auto manifest, read_bundle_manifest(text));
  std::string wrong;
  const auto add = [&](const std::string& what) { wrong += (wrong.empty() ? "" : "; ") + what; };
  std::set<std::string> named{std::string(k_bundle_manifest)};
  for (const auto& entry : manifest.entries) {
    if (!named.insert(entry.name).second) add(to_utf8(entry.name, 80) + " is in the manifest twice");
    const auto at = std::ranges::find(zip.entries(), entry.name, &ZipEntry::name);
    if (at == zip.entries().end()) {
      add(to_utf8(entry.name, 80) + " is missing");
      continue;
    }
    if (at->bytes != entry.bytes) {
      add(entry.name + " has " + std::to_string(at->bytes) + " bytes, not " + std::to_string(entry.bytes));
      continue;
    }
    const auto sum = zip.sha256_hex(entry.name);
    if (!sum)
      add(sum.error().message);
    else if (sum.value() != entry.sha256_hex)
      add(entry.name + " does not have the digest of the manifest");
  }
  for (const auto& entry : zip.entries()) {
    if (!named.contains(entry.name)) add(entry.name + " is not in the manifest");
  }
  if (!wrong.empty()) return refused("the bundle does not match its manifest: " + wrong);
  return manifest;
}

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
