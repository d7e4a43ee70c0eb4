#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/rest_client.hpp"
#include "server/cli/server_address.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::cli {
namespace {

constexpr int k_undecided = 3;  ///< a person has to decide whose positions hold

struct SyncOptions {
  std::string to, from, token_file, data_dir{"anchord-data"}, url, url_token_file, reason;
  std::vector<std::string> keep, sites;
  int wait_s{60}, timeout_s{30};
  bool dry_run{false}, activate_models{false};
  bool down() const { return !from.empty(); }
};

/// "field", "centre", or one of them for a site: "Hall 3=field".
Result<sync::Decisions> decisions_of(const std::vector<std::string>& words) {
  sync::Decisions out;
  for (const auto& word : words) {
    const auto equals = word.rfind('=');
    const auto keep = sync::k_keep_words.find(equals == std::string::npos ? word : word.substr(equals + 1));
    if (!keep)
      return make_error(Errc::invalid_argument, "--keep " + word + ": must be field, centre, or SITE=field");
    if (equals == std::string::npos)
      out.everywhere = *keep;
    else
      out.by_site[word.substr(0, equals)] = *keep;
  }
  return out;
}

unsigned long long n(std::uint64_t value) { return value; }

void print(const sync::Conflict& conflict) {
  const std::string site = conflict.site_id.empty() ? "anchors without a site"
                                                    : conflict.site_name + " (" + conflict.site_id + ")";
  std::printf("CONFLICT %s\n", printable(site).c_str());
  for (const auto& anchor : conflict.anchors) {
    std::printf("  %s\n    field   %s\n    centre  %s\n", printable(anchor.network_id).c_str(),
                printable(anchor.field).c_str(), printable(anchor.centre).c_str());
    if (anchor.distance_m) std::printf("    apart   %.3f m\n", *anchor.distance_m);
  }
}

void print_counts(const sync::Outcome& o, bool down) {
  const char* const sent = down ? "taken" : "sent";
  const char* const there = down ? "here" : "there";
  if (down) std::printf("sites: %llu %s, %llu already %s\n", n(o.sites_sent), sent, n(o.sites_there), there);
  if (down)
    std::printf("flights: %llu taken\n", n(o.flights_sent));
  else
    std::printf("flights: %llu sent, %llu already there, %llu not finished\n", n(o.flights_sent),
                n(o.flights_there), n(o.flights_recording));
  std::printf("models: %llu %s, %llu already %s\n", n(o.models_sent), sent, n(o.models_there), there);
  std::printf("profiles of kits: %llu %s, %llu already %s\n", n(o.profiles_sent), sent, n(o.profiles_there),
              there);
  std::printf("anchors: %llu published, %llu already %s, %llu left as published %s\n", n(o.anchors_published),
              n(o.anchors_there), there, n(o.anchors_left), there);
}

void print(const sync::Outcome& o, bool down, bool dry_run) {
  if (!dry_run) print_counts(o, down);
  for (const auto& one : o.differs) std::printf("differs: %s\n", printable(one).c_str());
  for (const auto& conflict : o.undecided) print(conflict);
  if (!o.undecided.empty())
    std::printf(
        "Both sides have published these: decide with --keep 'SITE=field' or --keep 'SITE=centre' (name or "
        "id), or with --keep field|centre for all\n");
  for (const auto& one : o.failed) std::printf("FAILED %s\n", printable(one).c_str());
}

Result<std::string> field_token(const SyncOptions& options) {
  if (!options.url_token_file.empty()) return read_token_file(options.url_token_file);
  return folder_token(options.data_dir);
}

Result<sync::Outcome> run(const SyncOptions& options, const sync::Decisions& decisions) {
  const auto local = options.url.empty() ? running_server(options.data_dir) : std::optional(options.url);
  if (!local)
    return make_error(Errc::not_found,
                      "no server is running on the data folder " + options.data_dir +
                          ": start anchord serve there, or give the field server with --url");
  sync::PeerOptions peer;
  peer.give_up = std::chrono::seconds(options.wait_s);
  peer.timeout = std::chrono::seconds(options.timeout_s);
  peer.report = [](const std::string& line) { std::fprintf(stderr, "%s\n", printable(line).c_str()); };
  peer.url = *local;
  peer.token_option = "--url-token-file";
  peer.role = options.down() ? "engineer" : "viewer";
  BOOST_OUTCOME_TRY(peer.token, field_token(options));
  BOOST_OUTCOME_TRY(const auto field, sync::Peer::to(peer));
  peer.url = options.down() ? options.from : options.to;
  peer.token_option = "--token-file";
  peer.role = options.down() ? "viewer" : "engineer";
  BOOST_OUTCOME_TRY(peer.token, read_token_file(options.token_file));
  BOOST_OUTCOME_TRY(const auto centre, sync::Peer::to(peer));
  sync::SyncOptions how;
  how.direction = options.down() ? sync::Direction::down : sync::Direction::up;
  how.sites = options.sites;
  how.activate_models = options.activate_models;
  how.reason = options.reason;
  how.dry_run = options.dry_run;
  how.decisions = decisions;
  how.state_file = std::filesystem::path(options.data_dir) / "sync.json";
  how.report = peer.report;
  return sync::sync(*field, *centre, how);
}

int sync_command(const SyncOptions& options) {
  if (options.to.empty() && options.from.empty())
    return failed("anchord sync", "give the centre with --to (after the trip) or --from (before it)", 2);
  const auto decisions = decisions_of(options.keep);
  if (!decisions) return failed("anchord sync", decisions.error().message, 2);
  const auto outcome = run(options, decisions.value());
  if (!outcome) {
    const bool input = outcome.error().code == Errc::invalid_argument;
    return failed("anchord sync",
                  outcome.error().message +
                      (input ? "" : "; what has arrived stays, run the command again to continue"),
                  input ? 2 : 1);
  }
  print(outcome.value(), options.down(), options.dry_run);
  if (!outcome.value().failed.empty()) return 1;
  return outcome.value().undecided.empty() ? 0 : k_undecided;
}

}  // namespace

void add_sync_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "sync", "Send the work of a running field server to the centre, or take from there what a trip needs");
  const auto options = std::make_shared<SyncOptions>();
  auto* to = command->add_option(
      "--to", options->to,
      "send finished flights, models and published positions to this centre, like https://centre.example");
  auto* from =
      command
          ->add_option("--from", options->from,
                       "take sites, plans, published positions, models and profiles from this centre")
          ->excludes(to);
  command->add_option(
      "--token-file", options->token_file,
      "file with an access token of the centre (role engineer; with --from viewer is enough); "
      "else ANCHORD_TOKEN");
  command
      ->add_option("--data-dir", options->data_dir, "data folder of the running field server [anchord-data]")
      ->envname("ANCHORD_DATA_DIR");
  command->add_option("--url", options->url, "address of the field server [that of its data folder]");
  command->add_option("--url-token-file", options->url_token_file,
                      "file with an access token of the field server [the admin token of its data folder]");
  command->add_option("--site", options->sites, "with --from: only this site, by name or id; may be repeated")
      ->allow_extra_args(false)
      ->needs(from);
  auto* activate =
      command
          ->add_flag("--activate-models", options->activate_models,
                     "with --from: models that are active at the centre become active here, if the gate "
                     "here passes them")
          ->needs(from);
  command
      ->add_option("--reason", options->reason,
                   "with --activate-models: why, where the gate does not pass one; kept with the promotion")
      ->needs(activate);
  command
      ->add_option("--keep", options->keep,
                   "where both have published: field or centre, or SITE=field for one site; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--wait", options->wait_s, "seconds to wait for a server that does not answer [60]")
      ->check(CLI::Range(1, 86'400));
  command
      ->add_option("--timeout", options->timeout_s,
                   "seconds within which an answer must begin, 20 times as many for one about a bundle [30]")
      ->check(CLI::Range(1, 3'600));
  command->add_flag("--dry-run", options->dry_run, "show what would be sent or taken, change nothing");
  command->callback([&exit_code, options] { exit_code = sync_command(*options); });
}

}  // namespace anchord::cli
