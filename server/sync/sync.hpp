#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"

namespace anchord::sync {

class Peer;

/// Whose published positions hold at the centre where both sides published others.
enum class Keep : std::uint8_t { field, centre };
inline constexpr auto k_keep_words = enum_table<Keep>({{"field", Keep::field}, {"centre", Keep::centre}});

struct Decisions {
  std::optional<Keep> everywhere{};
  std::map<std::string, Keep> by_site;  ///< id or name
  std::optional<Keep> of(const std::string& site_id, const std::string& site_name) const;
};

/// An anchor of which each side published a position that the other never had.
struct ConflictingAnchor {
  std::string network_id;
  std::string field, centre;         ///< position, revision and time, for people
  std::optional<double> distance_m;  ///< between the two; none where one is not on the globe
};
struct Conflict {
  std::string site_id, site_name;  ///< empty: anchors without a site
  std::vector<ConflictingAnchor> anchors;
};

struct Outcome {
  std::uint64_t flights_sent{}, flights_there{}, flights_recording{}, models_sent{}, models_there{};
  std::uint64_t anchors_published{}, anchors_there{}, anchors_left{};  ///< left: the centre's was kept
  std::vector<Conflict> undecided;
  std::vector<std::string> failed;  ///< what did not go, with the reason
};

struct SyncOptions {
  bool dry_run{false};  ///< nothing is sent
  Decisions decisions;
  std::filesystem::path state_file;  ///< what has arrived, so that it is not sent again
  std::function<void(const std::string& line)> report;
};

/// Notes and reports what did not go, with the reason.
void refused(Outcome& outcome, const SyncOptions& options, const std::string& what);

/// Field to centre: sites with their floors, finished flights as bundles, models, published positions. What
/// is there already stays; a repetition adds nothing. errors: of the links (what arrived has arrived)
Result<Outcome> sync_up(Peer& field, Peer& centre, const SyncOptions& options);

/// Its parts. Flights before positions, which rest on calibrations that come with them.
Result<void> send_sites(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome);
Result<void> send_flights(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome);
Result<void> send_models(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome);
Result<void> publish_positions(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome);

}  // namespace anchord::sync
