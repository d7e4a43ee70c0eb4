#include "server/sync/taken.hpp"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "server/runtime/private_file.hpp"
#include "server/sync/peer.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

constexpr const char* k_schema = "anchord.sync/1";

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

}  // namespace anchord::sync
