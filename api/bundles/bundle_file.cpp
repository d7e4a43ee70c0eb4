#include "api/bundles/bundle_file.hpp"

#include <algorithm>
#include <cerrno>

#include "api/bundles/spool.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_write_bytes = std::size_t{1} << 20;

}  // namespace

Result<void> FolderSink::begin(const BundleTable& table) {
  BOOST_OUTCOME_TRY(end());
  table_ = &table;
  entry_ = {bundle_entry_name(table), 0, 0, ""};
  file_ = std::ofstream(folder_.path(table.name), std::ios::binary);
  if (!file_) return failed();
  sum_ = Sha256();
  text_.clear();
  width_.reset();
  return boost::outcome_v2::success();
}

Result<void> FolderSink::row(const BundleRow& row) {
  if (++entry_.rows > k_bundle_rows)
    return make_error(Errc::unsupported, "there are more than " + std::to_string(k_bundle_rows) +
                                             " rows of " + table_->name + ", more than a bundle can hold");
  if (!width_) begin_text(&row);
  text_ += bundle_line(*table_, row, *width_);
  if (text_.size() < k_write_bytes) return boost::outcome_v2::success();
  return flush();
}

Result<void> FolderSink::end() {
  if (table_ == nullptr) return boost::outcome_v2::success();
  if (table_->later && entry_.rows == 0) {
    table_ = nullptr;
    return boost::outcome_v2::success();
  }
  if (!width_) begin_text(nullptr);
  BOOST_OUTCOME_TRY(flush());
  file_.close();
  if (!file_) return failed();
  entry_.sha256_hex = sum_.hex();
  entries_.push_back(entry_);
  table_ = nullptr;
  return boost::outcome_v2::success();
}

void FolderSink::begin_text(const BundleRow* first) {
  width_ = bundle_width(*table_, first);
  text_ = bundle_header(*table_, *width_);
}

Result<void> FolderSink::flush() {
  sum_.add(text_);
  entry_.bytes += text_.size();
  errno = 0;
  if (!file_.write(text_.data(), static_cast<std::streamsize>(text_.size()))) return failed();
  text_.clear();
  return boost::outcome_v2::success();
}

Error FolderSink::failed() const {
  return make_error(errno == ENOSPC ? Errc::storage_full : Errc::storage_unavailable,
                    "cannot write " + entry_.name + " of the bundle");
}

Result<FlightBundle> make_bundle(BundleApi& api, const Mission& mission, const Principal& who,
                                 const SpoolFolder& folder) {
  BundleManifest manifest{mission.id, mission.name, api.made_by, api.clock.now(), {}};
  FolderSink sink(folder, manifest.entries);
  BOOST_OUTCOME_TRY(api.bundles.write_out(mission.id, sink));
  BOOST_OUTCOME_TRY(sink.end());
  const std::size_t n_tables = manifest.entries.size();
  auto notes = api.notes(mission, who);
  for (const auto& note : notes) {
    Sha256 sum;
    sum.add(note.text);
    manifest.entries.push_back(
        {std::string(k_bundle_notes) + note.name, note.text.size(), note.rows, sum.hex()});
  }
  const auto file = folder.path("bundle.anchord");
  BOOST_OUTCOME_TRY(auto zip, ZipWriter::create(file));
  BOOST_OUTCOME_TRY(zip.add_text(std::string(k_bundle_manifest), write_bundle_manifest(manifest)));
  for (const auto& table : api.bundles.tables()) {
    const auto name = bundle_entry_name(table);
    if (std::ranges::find(manifest.entries, name, &BundleEntry::name) == manifest.entries.end()) continue;
    BOOST_OUTCOME_TRY(zip.add_file(name, folder.path(table.name)));
  }
  for (std::size_t i = 0; i < notes.size(); ++i) {
    BOOST_OUTCOME_TRY(zip.add_text(manifest.entries[n_tables + i].name, std::move(notes[i].text)));
  }
  BOOST_OUTCOME_TRY(zip.finish());
  for (const auto& table : api.bundles.tables()) {
    std::error_code gone;
    std::filesystem::remove(folder.path(table.name), gone);
  }
  Sha256 all;
  for (const auto& entry : manifest.entries) all.add(entry.name + ' ' + entry.sha256_hex + '\n');
  return FlightBundle{file, all.hex()};
}

Result<BundleEntry> entry_of(const std::string& name, const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  BundleEntry entry{name, 0, 0, ""};
  Sha256 sum;
  std::vector<char> buffer(k_write_bytes);
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    const auto n = static_cast<std::size_t>(file.gcount());
    sum.add(std::string_view(buffer.data(), n));
    entry.bytes += n;
  }
  if (!file.eof()) return make_error(Errc::storage_unavailable, "cannot read " + name + " again");
  entry.sha256_hex = sum.hex();
  return entry;
}

Result<void> BundleZipSource::open(const BundleTable& table) {
  table_ = &table;
  check_.emplace(table);
  lines_.reset();
  if (table.later && !zip_.has(bundle_entry_name(table))) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(auto lines, ZipLines::open(zip_, bundle_entry_name(table)));
  lines_ = std::move(lines);
  std::string_view line;
  BOOST_OUTCOME_TRY(const bool more, lines_->next(line));
  BOOST_OUTCOME_TRY(width_, read_bundle_header(table, more ? line : std::string_view{}));
  return boost::outcome_v2::success();
}

Result<bool> BundleZipSource::next(BundleRow& row) {
  if (!lines_) return false;
  std::string_view line;
  BOOST_OUTCOME_TRY(const bool more, lines_->next(line));
  if (!more) return false;
  const std::string at = bundle_entry_name(*table_) + " line " + std::to_string(lines_->number());
  if (lines_->number() > k_bundle_rows + 1)
    return make_error(Errc::invalid_argument, at + " is beyond the largest number of rows of a bundle");
  auto read = read_bundle_line(*table_, line, width_);
  if (!read) return make_error(read.error().code, at + ": " + read.error().message);
  row = std::move(read).value();
  if (const auto fault = check_->fault_of(row); !fault.empty())
    return make_error(Errc::bad_frame, at + ": " + fault);
  return true;
}

}  // namespace anchord::api
