#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace anchord::api {

/// One line of a plain .txt: time in milliseconds, distance in millimetres and, where it is there, RSS in
/// dBm, in this order, whatever of blanks, separators, names and these units stands between them. Whatever
/// else it says is a fault: a line that is not understood is no measurement. Where blanks, tabs or semicolons
/// stand between numbers, a comma inside one is a decimal comma.
struct CampaignLine {
  double t_ms{}, distance_mm{};
  std::optional<double> rss_dbm{};
  bool too_few{false};  ///< of numbers; `fault` says so
  std::string fault{};  ///< what is not understood, and what to do; empty: nothing
};
CampaignLine read_campaign_line(std::string_view line);

/// True where every word of the line is one that such a line may have: no header of a table.
bool is_campaign_line(std::string_view line);

}  // namespace anchord::api
