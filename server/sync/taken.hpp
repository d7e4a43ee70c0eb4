#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/base/result.hpp"

namespace anchord::sync {

/// What a centre has of each flight and site: a digest of what was sent to it or came from it, by URL and id.
/// A saving alone: without it everything is sent again and found there. One at a time for a file.
class Taken {
 public:
  Taken(std::filesystem::path file, std::string url);
  bool has(const std::string& id, const std::string& digest) const;
  void forget(const std::string& id);
  Result<void> note(const std::string& id, const std::string& digest);

 private:
  std::filesystem::path file_;
  std::string url_;
  std::map<std::string, std::map<std::string, std::string>> all_;  ///< digests by URL and id
};

}  // namespace anchord::sync
