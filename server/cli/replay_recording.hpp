#pragma once

#include <limits>
#include <string>

namespace anchord::cli {

class RestClient;

struct RecordingTarget {
  std::string name;     ///< of missions the server does not have; empty: that of the file
  std::string mission;  ///< of the server, to which every row goes; empty: each to its own
  double speed{std::numeric_limits<double>::infinity()};  ///< times the pace of the recording
};

/// Rows of a raw recording, derived again by the drivers, as NDJSON into a folder ("-": standard output).
/// Exit code: 0 done, 1 could not be written, 2 no recording.
int derive_recording(const std::string& file, const std::string& folder);

/// ... sent to a server. Rows keep their identities: what the server has already is known there. A mission
/// the server does not have is made anew, and finished afterwards. Exit code: 0 all there, 1 refused or
/// unreachable, 2 no recording.
int play_recording(const std::string& file, const RecordingTarget& target, RestClient& client);

}  // namespace anchord::cli
