#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdio>
#include <thread>

#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/rest_client.hpp"
#include "server/cli/server_address.hpp"
#include "server/cli/top_screen.hpp"
#include "server/http/http_client.hpp"

namespace anchord::cli {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr auto k_answer_within = std::chrono::seconds(3);  ///< also how long Ctrl-C may have to wait
constexpr auto k_look_every = std::chrono::milliseconds(50);

struct TopOptions {
  std::string url, data_dir{"anchord-data"}, token_file;
  double interval_s{1};
  bool once{false}, data_dir_given{false};
};

/// The folder's own token is for the folder's own server: an address that was named gets it only when the
/// folder was named too.
Result<std::string> token_for(const TopOptions& options) {
  if (!options.token_file.empty()) return read_token_file(options.token_file);
  if (options.url.empty() || options.data_dir_given) return own_token(options.data_dir);
  return read_token_file("");
}

struct Question {
  const char* target;
  TopDocument TopDocuments::*to;
};

// Short pages: what is queued, runs or records is among the newest.
constexpr std::array k_questions{Question{"/version", &TopDocuments::version},
                                 Question{"/readyz", &TopDocuments::ready},
                                 Question{"/api/v1/system", &TopDocuments::system},
                                 Question{"/api/v1/alarms", &TopDocuments::alarms},
                                 Question{"/api/v1/missions?limit=20", &TopDocuments::missions},
                                 Question{"/api/v1/devices", &TopDocuments::devices},
                                 Question{"/api/v1/jobs?limit=50", &TopDocuments::jobs},
                                 Question{"/metrics", &TopDocuments::metrics}};

TopDocument document_of(const Question& question, server::ClientResponse answer) {
  const bool unready = answer.status == 503 && question.to == &TopDocuments::ready;
  if (answer.status == 200 || unready) return {std::move(answer.body), {}};
  std::string why = std::to_string(answer.status) + " " + api::problem_text(answer.body);
  if (answer.status == 401) why += "; give a token with --token-file or ANCHORD_TOKEN";
  return {{}, std::move(why)};
}

/// errors  link_lost: the server does not answer; canceled: interrupted
Result<TopDocuments> read_all(server::HttpClient& client) {
  TopDocuments out;
  for (const auto& question : k_questions) {
    if (interrupted()) return make_error(Errc::canceled, "stopped");
    BOOST_OUTCOME_TRY(auto answer, client.call("GET", question.target));
    out.*question.to = document_of(question, std::move(answer));
  }
  return out;
}

TopSize terminal_size() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {80, 24};
  return {size.ws_col, size.ws_row};
}

/// The other screen of a terminal, without cursor and line wrap, for as long as it lives.
class AlternateScreen {
 public:
  AlternateScreen() { put("\x1b[?1049h\x1b[?25l\x1b[?7l"); }
  ~AlternateScreen() { put("\x1b[?7h\x1b[?25h\x1b[?1049l"); }
  AlternateScreen(const AlternateScreen&) = delete;
  AlternateScreen& operator=(const AlternateScreen&) = delete;

  /// In one write, over what is there: clearing first would flicker.
  bool show(const std::vector<std::string>& lines) {
    std::string out = "\x1b[H";
    for (std::size_t i = 0; i < lines.size(); ++i) out += (i > 0 ? "\r\n" : "") + lines[i] + "\x1b[K";
    return put(out + "\x1b[J");
  }

 private:
  static bool put(const std::string& text) {
    return std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  }
};

/// Shows the reading until `until`; again when the terminal changes its size. False: nobody can see it.
bool show_until(AlternateScreen& screen, const TopDocuments& documents, TopReading& reading,
                SteadyClock::time_point until) {
  TopSize shown{};
  do {
    const auto size = terminal_size();
    if (size.columns != shown.columns || size.rows != shown.rows) {
      reading.now = SystemClock().now();
      if (!screen.show(top_lines(documents, reading, size))) return false;
      shown = size;
    }
    std::this_thread::sleep_for(k_look_every);
  } while (SteadyClock::now() < until && !interrupted());
  return true;
}

int watch(server::HttpClient& client, TopDocuments documents, TopReading reading, double interval_s) {
  const auto interval =
      std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(interval_s));
  AlternateScreen screen;
  auto next = SteadyClock::now() + interval;
  while (!interrupted()) {
    if (!show_until(screen, documents, reading, next)) return 1;
    if (interrupted()) break;
    next = SteadyClock::now() + interval;
    auto read = read_all(client);
    const auto now = SystemClock().now();
    if (read) {
      documents = std::move(read).value();
      reading.read_at = now;
      reading.away.reset();
    } else if (read.error().code != Errc::canceled) {
      reading.away = TopAway{reading.away ? reading.away->since : now, read.error().message};
    }
  }
  return 0;
}

int top(const TopOptions& options) {
  const auto token = token_for(options);
  if (!token) return failed("anchord top", token.error().message, 2);
  const auto url =
      !options.url.empty() ? options.url : running_server(options.data_dir).value_or("http://127.0.0.1:8420");
  auto client = server::HttpClient::to(url, k_answer_within);
  if (!client) return failed("anchord top", client.error().message, 2);
  if (!token.value().empty()) client.value().set_header("Authorization", "Bearer " + token.value());
  interrupted();  // from here on a signal is remembered, so that the terminal is restored
  auto first = read_all(client.value());
  if (!first && first.error().code == Errc::canceled) return 0;
  if (!first)
    return failed("anchord top",
                  "no anchord server answers at " + url + ": " + first.error().message +
                      " ('anchord doctor' looks). Give another address with --url",
                  1);
  auto documents = std::move(first).value();
  if (!documents.system.problem.empty() && !documents.devices.problem.empty())
    return failed("anchord top", url + ": " + documents.system.problem, 1);
  const auto now = SystemClock().now();
  const TopReading reading{url, now, now, {}};
  if (!options.once && ::isatty(STDOUT_FILENO) != 0)
    return watch(client.value(), std::move(documents), reading, options.interval_s);
  for (const auto& line : top_lines(documents, reading, {})) std::printf("%s\n", line.c_str());
  return std::fflush(stdout) == 0 ? 0 : 1;
}

}  // namespace

void add_top_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "top", "Show a running server on one screen: alarms, mission, devices, queues, jobs (Ctrl-C ends)");
  const auto options = std::make_shared<TopOptions>();
  command->add_flag("--once", options->once,
                    "print once as plain text; this is also done when the output is a file or pipe");
  command->add_option("--interval", options->interval_s, "seconds between two readings [1]")
      ->check(CLI::Range(0.2, 3600.0));
  command->add_option("--url", options->url, "address of the server [the server of the data folder]");
  auto* folder = command->add_option("--data-dir", options->data_dir, "folder of the database [anchord-data]")
                     ->envname("ANCHORD_DATA_DIR");
  command->add_option("--token-file", options->token_file,
                      "file with an access token (viewer) [ANCHORD_TOKEN, else that of the data folder]");
  command->callback([&exit_code, options, folder] {
    options->data_dir_given = folder->count() > 0;
    exit_code = top(*options);
  });
}

}  // namespace anchord::cli
