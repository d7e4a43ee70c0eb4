#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"

/// The screen of anchord top: documents of the server in, lines of text out. Pure; any thread.
namespace anchord::cli {

/// What the server answered.
struct TopDocument {
  std::string body;
  std::string problem;  ///< why there is no body to show; empty when there is
};

/// One reading of the server, in the words of api/openapi.yaml.
struct TopDocuments {
  TopDocument version;   ///< GET /version
  TopDocument ready;     ///< GET /readyz, of status 200 or 503
  TopDocument system;    ///< GET /api/v1/system
  TopDocument alarms;    ///< GET /api/v1/alarms
  TopDocument devices;   ///< GET /api/v1/devices
  TopDocument missions;  ///< GET /api/v1/missions
  TopDocument jobs;      ///< GET /api/v1/jobs
  TopDocument metrics;   ///< GET /metrics
};

struct TopAway {
  UtcTime since;
  std::string why;
};

struct TopReading {
  std::string url;
  UtcTime now;                  ///< of this machine
  UtcTime read_at;              ///< when the documents came, by the same clock
  std::optional<TopAway> away;  ///< the server does not answer any more: the documents are old
};

/// Of the terminal, in characters; 0: no limit.
struct TopSize {
  std::size_t columns{}, rows{};
};

/// No line holds a control character, whatever the documents hold, and none is longer than the terminal is
/// wide. When it is not high enough, the longest sections end early and say how much they leave out. A
/// document that is not what the contract promises is shown as far as it can be read.
std::vector<std::string> top_lines(const TopDocuments& documents, const TopReading& reading, TopSize size);

}  // namespace anchord::cli
