#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/rest_client.hpp"
#include "server/cli/server_address.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::cli {
namespace {

constexpr int k_undecided = 3;  ///< a person has to say whose positions stand

struct Options {
  std::string to, token_file, data_dir{"anchord-data"}, url;
  std::vector<std::string> keep;
  int wait_s{60};
  bool dry_run{false};
};

int fail(const std::string& message, int code) {
  std::fprintf(stderr, "anchord sync: %s\n", printable(message).c_str());
  return code;
}

/// "ours", "theirs", or one of them for a site: "Hall 3=ours".
Result<sync::Decisions> decisions_of(const std::vector<std::string>& words) {
  sync::Decisions out;
  for (const auto& word : words) {
    const auto equals = word.rfind('=');
    const auto keep = sync::k_keep_words.find(equals == std::string::npos ? word : word.substr(equals + 1));
    if (!keep)
      return make_error(Errc::invalid_argument, "--keep " + word + ": say ours, theirs, or SITE=ours");
    if (equals == std::string::npos)
      out.everywhere = *keep;
    else
      out.by_site[word.substr(0, equals)] = *keep;
  }
  return out;
}

/// A folder for bundles on their way, gone in the end.
class Scratch {
 public:
  Scratch() {
    std::string pattern = (std::filesystem::temp_directory_path() / "anchord-sync-XXXXXX").string();
    if (::mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  ~Scratch() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

unsigned long long n(std::uint64_t value) { return value; }

void print(const sync::Outcome& o, bool dry_run) {
  if (!dry_run)
    std::printf(
        "flights: %llu sent, %llu there already, %llu not finished\nmodels: %llu sent, %llu there already\n"
        "anchors: %llu published, %llu there already, %llu left as they are there\n",
        n(o.flights_sent), n(o.flights_there), n(o.flights_recording), n(o.models_sent), n(o.models_there),
        n(o.anchors_published), n(o.anchors_there), n(o.anchors_left));
  for (const auto& c : o.undecided) {
    std::string anchors;
    for (const auto& id : c.anchors) anchors += (anchors.empty() ? "" : " ") + id;
    const std::string site = c.site_id.empty() ? "no site" : c.site_name + " (" + c.site_id + ")";
    std::printf("CONFLICT %s\n  ours    %s\n  theirs  %s\n  anchors %s\n", printable(site).c_str(),
                printable(c.ours).c_str(), printable(c.theirs).c_str(), printable(anchors).c_str());
  }
  if (!o.undecided.empty())
    std::printf(
        "both sides published these: decide by --keep 'SITE=ours' or --keep 'SITE=theirs' (name or id), or "
        "--keep ours|theirs for all\n");
  for (const auto& one : o.failed) std::printf("FAILED %s\n", printable(one).c_str());
}

Result<sync::Outcome> run(const Options& options, const sync::Decisions& decisions) {
  const auto local = options.url.empty() ? running_server(options.data_dir) : std::optional(options.url);
  if (!local)
    return make_error(Errc::not_found, "no server runs in " + options.data_dir +
                                           ": start anchord serve there, or name the field server by --url");
  BOOST_OUTCOME_TRY(const auto token, read_token_file(options.token_file));
  const std::chrono::seconds give_up(options.wait_s);
  BOOST_OUTCOME_TRY(const auto field,
                    sync::Peer::to({*local, own_token(options.data_dir), give_up, interrupted}));
  BOOST_OUTCOME_TRY(const auto centre, sync::Peer::to({options.to, token, give_up, interrupted}));
  const Scratch scratch;
  if (scratch.path().empty()) return make_error(Errc::storage_unavailable, "no temporary folder can be made");
  std::error_code ignored;
  const bool has_folder = std::filesystem::is_directory(options.data_dir, ignored);
  sync::SyncOptions how;
  how.dry_run = options.dry_run;
  how.decisions = decisions;
  how.scratch = scratch.path();
  how.state_file = (has_folder ? std::filesystem::path(options.data_dir) : scratch.path()) / "sync.json";
  how.tell = [](const std::string& line) { std::fprintf(stderr, "%s\n", printable(line).c_str()); };
  return sync::sync_up(*field, *centre, how);
}

int sync_command(const Options& options) {
  const auto decisions = decisions_of(options.keep);
  if (!decisions) return fail(decisions.error().message, 2);
  (void)interrupted();
  const auto outcome = run(options, decisions.value());
  if (!outcome) {
    const bool input = outcome.error().code == Errc::invalid_argument;
    return fail(outcome.error().message + (input ? "" : "; what has arrived stays, run it again to go on"),
                input ? 2 : 1);
  }
  print(outcome.value(), options.dry_run);
  if (!outcome.value().failed.empty()) return 1;
  return outcome.value().undecided.empty() ? 0 : k_undecided;
}

}  // namespace

void add_sync_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "sync", "Bring finished flights, models and published positions of a running server to another");
  const auto options = std::make_shared<Options>();
  command->add_option("--to", options->to, "address of the centre, like https://centre.example")->required();
  command->add_option("--token-file", options->token_file,
                      "file with an access token of the centre (role engineer); else ANCHORD_TOKEN");
  command
      ->add_option("--data-dir", options->data_dir, "folder of the field server, which runs [anchord-data]")
      ->envname("ANCHORD_DATA_DIR");
  command->add_option("--url", options->url, "address of the field server; else that of its folder");
  command
      ->add_option("--keep", options->keep,
                   "where both published: ours or theirs, or of one site SITE=ours; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--wait", options->wait_s, "seconds to wait for a server that does not answer [60]")
      ->check(CLI::Range(1, 86'400));
  command->add_flag("--dry-run", options->dry_run, "show what would go, send nothing");
  command->callback([&exit_code, options] { exit_code = sync_command(*options); });
}

}  // namespace anchord::cli
