#include "server/sync/taken.hpp"

#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

#include "api/formats/bundle_manifest.hpp"
#include "core/base/to_wire.hpp"
#include "server/runtime/private_file.hpp"
#include "server/sync/peer.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

constexpr const char* k_schema = "anchord.sync/1";
constexpr std::uint64_t k_manifest_bytes = 1u << 20;

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

}  // namespace

Taken::Taken(std::filesystem::path file, std::string url) : file_(std::move(file)), url_(std::move(url)) {
  std::ifstream in(file_);
  const auto kept = Json::parse(std::string(std::istreambuf_iterator<char>(in), {}), nullptr, false);
  if (!kept.is_object() || text_of(kept, "schema") != k_schema) return;
  for (const auto& [centre, digests] : kept.items()) {
    if (!digests.is_object()) continue;
    for (const auto& [id, digest] : digests.items())
      if (digest.is_string()) all_[centre][id] = digest.get<std::string>();
  }
}

bool Taken::has(const std::string& id, const std::string& digest) const {
  const auto there = all_.find(url_);
  if (there == all_.end()) return false;
  const auto known = there->second.find(id);
  return known != there->second.end() && known->second == digest;
}

void Taken::forget(const std::string& id) { all_[url_].erase(id); }

Result<void> Taken::note(const std::string& id, const std::string& digest) {
  all_[url_][id] = digest;
  Json kept{{"schema", k_schema}};
  for (const auto& [centre, digests] : all_) kept[centre] = digests;
  return server::write_private(file_, to_wire(kept, 1) + "\n");
}

std::string megabytes(std::size_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f MB", static_cast<double>(bytes) / 1e6);
  return text;
}

Result<std::string> manifest_of(const std::string& bundle) {
  // A file without a name: what is killed here leaves nothing behind.
  const std::unique_ptr<std::FILE, CloseFile> file(std::tmpfile());
  if (!file || std::fwrite(bundle.data(), 1, bundle.size(), file.get()) != bundle.size() ||
      std::fflush(file.get()) != 0)
    return make_error(Errc::storage_full,
                      "not enough space in /tmp for a bundle of " + megabytes(bundle.size()));
  BOOST_OUTCOME_TRY(const auto zip,
                    api::ZipReader::open("/proc/self/fd/" + std::to_string(fileno(file.get()))));
  return zip.text(api::k_bundle_manifest, k_manifest_bytes);
}

}  // namespace anchord::sync
