#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"

namespace anchord::sync {

class Peer;

/// Whose published positions stand at the centre where both sides published others.
enum class Keep : std::uint8_t { ours, theirs };
inline constexpr auto k_keep_words = enum_table<Keep>({{"ours", Keep::ours}, {"theirs", Keep::theirs}});

struct Decisions {
  std::optional<Keep> everywhere{};
  std::map<std::string, Keep> by_site;  ///< id or name
  std::optional<Keep> of(const std::string& site_id, const std::string& site_name) const;
};

/// One site of which both sides published positions that the other does not know.
struct Conflict {
  std::string site_id, site_name;    ///< empty: anchors without a site
  std::vector<std::string> anchors;  ///< network ids
  std::string ours, theirs;          ///< "revision 3 of 2026-05-04T10:11:12Z"
};

struct Outcome {
  std::uint64_t flights_sent{}, flights_there{}, flights_recording{}, models_sent{}, models_there{};
  std::uint64_t anchors_published{}, anchors_there{}, anchors_left{};  ///< left: theirs was kept
  std::vector<Conflict> undecided;
  std::vector<std::string> failed;  ///< what did not go, with the reason
};

struct SyncOptions {
  bool dry_run{false};  ///< nothing is sent
  Decisions decisions;
  std::filesystem::path state_file;  ///< digests of what has arrived, so that it is not made again
  std::filesystem::path scratch;     ///< a folder for bundles on their way
  std::function<void(const std::string& line)> tell;
};

/// What a server has goes to another: finished flights as bundles, models, published positions. What is there
/// already stays; a repetition adds nothing. errors: of the links (what arrived has arrived)
Result<Outcome> sync_up(Peer& field, Peer& centre, const SyncOptions& options);

/// Its three parts. `flights` first: positions rest on calibrations that come with them.
Result<void> send_flights(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome);
Result<void> send_models(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome);
Result<void> publish_positions(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome);

}  // namespace anchord::sync
