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

/// Whose published positions hold where both sides published others.
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

/// Sent: what arrived at the target. There: what it had.
struct Outcome {
  std::uint64_t sites_sent{}, sites_there{};
  std::uint64_t flights_sent{}, flights_there{}, flights_recording{}, models_sent{}, models_there{};
  std::uint64_t profiles_sent{}, profiles_there{};
  std::uint64_t anchors_published{}, anchors_there{}, anchors_left{};  ///< left: the target's was kept
  std::vector<Conflict> undecided;
  std::set<std::string> differs;    ///< what is at the target in another version, and stays
  std::vector<std::string> failed;  ///< what did not go, with the reason
};

enum class Direction : std::uint8_t { up, down };  ///< to the centre; from the centre, before the trip

struct SyncOptions {
  Direction direction{Direction::up};
  bool dry_run{false};  ///< nothing is sent
  Decisions decisions;
  std::vector<std::string> sites;    ///< down: of these, by name or id; none: of all
  bool activate_models{false};       ///< down: those active at the centre, through the field's own gate
  std::string reason;                ///< of a person, where that gate refuses one
  std::filesystem::path state_file;  ///< what the centre has, so that it is not sent again
  std::function<void(const std::string& line)> report;
};

struct Site {
  std::string id, name;
};

/// One run: what is where, and what came of it so far.
struct Run {
  Peer &field, &centre;
  const SyncOptions& options;
  Outcome outcome{};
  std::vector<Site> sites{};  ///< down: those that were chosen
  bool in_parts{true};        ///< the centre takes bundles in parts, as far as is known
  bool whole_servers{true};   ///< neither token is bound to sites: models and profiles go too

  bool up() const { return options.direction == Direction::up; }
  Peer& source() const { return up() ? field : centre; }
  Peer& target() const { return up() ? centre : field; }
  void report(const std::string& line) const { options.report(line); }
  /// Notes and reports what did not go, with the reason.
  void failed(const std::string& what);
  /// What the target left out of a bundle: there in another version, or it cannot stand there.
  void left_out(const std::string& of, const std::string& what, const std::string& why);
};

/// Up: sites that have buildings, finished flights as bundles, models, profiles of kits, published positions.
/// Down: the same of the chosen sites, and of flights those alone that published positions rest on. What is
/// there already stays; a repetition adds nothing. errors: of the links (what arrived has arrived)
Result<Outcome> sync(Peer& field, Peer& centre, const SyncOptions& options);

/// Its parts. Flights before positions, which rest on calibrations that come with them.
Result<void> send_sites(Run& run);
/// All finished ones, or only those that a calibration of these needs.
Result<void> send_flights(Run& run, const std::set<std::string>* calibrations);
Result<void> send_models(Run& run);
Result<void> send_profiles(Run& run);
/// Calibrations that publish_positions would publish at the target.
Result<std::set<std::string>> wanted_calibrations(const Run& run);
Result<void> publish_positions(Run& run);

}  // namespace anchord::sync
