#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "api/formats/labelled_table.hpp"
#include "core/base/result.hpp"
#include "core/types/campaign.hpp"

/// A measurement campaign from CSV, NDJSON, or the plain .txt of one measurement a line (docs/learning.md,
/// "Campaigns").
namespace anchord::api {

enum class CampaignFormat { detect, csv, ndjson, txt };
inline constexpr auto k_campaign_format_words =
    enum_table<CampaignFormat>({{"detect", CampaignFormat::detect},
                                {"csv", CampaignFormat::csv},
                                {"ndjson", CampaignFormat::ndjson},
                                {"txt", CampaignFormat::txt}});

struct CampaignOptions {
  CampaignFormat format{CampaignFormat::detect};
  CampaignSite defaults{};      ///< truth of rows that name none: how a .txt says what it is of
  std::string los_value{};      ///< what means LOS in a column of a class that does not say it by its name
  bool filter{true};            ///< drop outliers of each site (6.2.1); zero ranges are always faults
  double outlier_mads{8};       ///< of 1.4826 MAD off the site's median range, from 5 measurements on
  double outlier_floor_m{0.5};  ///< and never nearer than this: a quiet site has a tiny MAD
};

/// One line that was not kept.
struct CampaignLineError {
  std::size_t line{};
  std::string column{};  ///< as the source spells it; empty where the whole line is at fault
  std::string detail{};
};

/// What one reason cost, and its first lines: enough to open the file and see.
struct CampaignDrop {
  static constexpr std::size_t k_most_named = 20;
  std::size_t count{};
  std::vector<CampaignLineError> first{};  ///< at most k_most_named, in the order of the source
};

/// What was read, and everything that was not kept.
struct CampaignReport {
  CampaignFormat format{};
  std::size_t lines{};  ///< measurements seen
  std::size_t kept{};
  /// By reason: "missing value", "impossible value", "unreadable line", "zero range", "range off its site's
  /// median".
  std::map<std::string, CampaignDrop> dropped{};
  std::vector<CampaignLineError> errors{};  ///< the first 100 that could not be used, whatever the reason
  struct Site {
    std::string name{};
    std::size_t kept{}, zero{}, outliers{};
    double median_m{}, sd_m{};
  };
  std::vector<Site> sites{};                     ///< as Campaign::sites
  std::vector<std::string> warnings{};           ///< names that differ in capitals or blanks alone
  std::vector<std::string> oddities{};           ///< ranges that are no metres
  std::vector<std::string> unused{};             ///< columns and keys that nothing was taken from
  std::map<std::string, std::string> classes{};  ///< column of the class -> the value that was taken for LOS
};

struct CampaignImport {
  Campaign campaign{};
  CampaignReport report{};
};

/// Bad lines never sink good ones: they are counted and named.
/// text    UTF-8, or UTF-16 with its mark; see docs/learning.md for the columns and for the `# key = value`
/// lines of a .txt
/// errors  bad_frame (no text, no header, no line that can be read), invalid_argument (no range column, two
/// of one name, a class that does not say what is LOS, ranges and truth of two units)
Result<CampaignImport> import_campaign(std::string_view text, const CampaignOptions& options = {});

/// The campaign as a table of labelled rangings: features computed, a place per environment, a placement per
/// site; sites without a name of an environment are places of their own.
LabelledTable table_of(const Campaign& campaign);

/// CSV of everything kept but impulse responses, ground truth in every row: read again, it is the same
/// campaign.
std::string campaign_csv(const Campaign& campaign);

}  // namespace anchord::api
