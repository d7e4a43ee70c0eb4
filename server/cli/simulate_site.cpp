#include "server/cli/simulate_site.hpp"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "core/base/text.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/rest_client.hpp"
#include "server/cli/site_flight.hpp"
#include "server/cli/site_learning.hpp"

namespace anchord::cli {
namespace {

struct SimulatedSiteOptions {
  std::string url{"http://127.0.0.1:8420"}, token_file;
  bool over_others{false};
};

void tell(const std::string& words) {
  std::fprintf(stderr, "anchord simulate site: %s\n", printable(words).c_str());
}

Result<void> add_all(const SimulatedSiteOptions& options) {
  BOOST_OUTCOME_TRY(const auto token, read_token_file(options.token_file));
  BOOST_OUTCOME_TRY(const auto client, RestClient::make(options.url, token, interrupted));
  // The model first: ranges of the flight are classified by what is active when they come.
  BOOST_OUTCOME_TRYV(add_demonstration_model(*client, options.over_others, tell));
  return add_demonstration_flight(*client, options.over_others, tell);
}

int simulate_site(const SimulatedSiteOptions& options) {
  const auto done = add_all(options);
  if (done) return 0;
  tell(done.error().message + "; what was added stays, and the same command continues from there");
  return 1;
}

}  // namespace

void add_simulate_site(CLI::App& simulate, int& exit_code) {
  auto o = std::make_shared<SimulatedSiteOptions>();
  auto* command = simulate.add_subcommand(
      "site",
      "Add a labelled campaign, a trained and promoted model, a finished flight and a published revision of "
      "the demonstration building to a running server; existing data stays");
  command->add_option("--url", o->url, "of the server")->capture_default_str();
  command->add_option("--token-file", o->token_file,
                      "file with an access token (gateway, operator and engineer)");
  command->add_flag("--over-others", o->over_others,
                    "Promote and publish even if another model is active or another revision is published");
  command->callback([o, &exit_code] { exit_code = simulate_site(*o); });
}

}  // namespace anchord::cli
