#include "server/runtime/chromium_pdf.hpp"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "server/runtime/start_program.hpp"

namespace anchord::server {
namespace {

constexpr std::array k_programs{"/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"};
constexpr std::chrono::seconds k_patience{60};
constexpr std::chrono::milliseconds k_look{20};

std::string installed() {
  for (const char* program : k_programs)
    if (::access(program, X_OK) == 0) return program;
  return {};
}

/// Whether it ended by itself, well.
bool ended_well(pid_t pid) {
  const auto until = std::chrono::steady_clock::now() + k_patience;
  int status = 0;
  while (::waitpid(pid, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > until) {
      ::kill(-pid, SIGKILL);
      ::waitpid(pid, &status, 0);
      return false;
    }
    std::this_thread::sleep_for(k_look);
  }
  ::kill(-pid, SIGKILL);  // helpers of it that have not noticed yet
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// As the address of a page: of a folder whose path is relative, or has a # or % in it, too.
std::string file_url(const std::filesystem::path& file) {
  constexpr std::string_view k_plain = "/-._~";
  std::string out = "file://";
  for (const char c : std::filesystem::absolute(file).string()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool word =
        (byte >= '0' && byte <= '9') || (byte >= 'A' && byte <= 'Z') || (byte >= 'a' && byte <= 'z');
    char coded[4] = {};
    std::snprintf(coded, sizeof coded, "%%%02X", byte);
    out += word || k_plain.find(c) != std::string_view::npos ? std::string(1, c) : std::string(coded);
  }
  return out;
}

bool print(const std::string& program, const std::filesystem::path& html, const std::filesystem::path& pdf,
           bool sandboxed) {
  const auto profile = pdf.parent_path() / "chromium";
  std::vector<std::string> words{program,
                                 "--headless",
                                 "--disable-gpu",
                                 "--disable-dev-shm-usage",
                                 "--disable-background-networking",
                                 "--host-resolver-rules=MAP * ~NOTFOUND",
                                 "--user-data-dir=" + std::filesystem::absolute(profile).string(),
                                 "--no-pdf-header-footer",
                                 "--print-to-pdf=" + std::filesystem::absolute(pdf).string()};
  if (!sandboxed) words.emplace_back("--no-sandbox");
  words.push_back(file_url(html));
  const auto pid = start_program({.program = program,
                                  .arguments = std::move(words),
                                  .environment = {"PATH=/usr/bin:/bin"},
                                  .own_group = true});
  const bool well = pid && ended_well(pid.value());
  std::error_code gone;
  std::filesystem::remove_all(profile, gone);
  return well && std::filesystem::file_size(pdf, gone) > 0 && !gone;
}

}  // namespace

Result<void> print_with_chromium(const std::filesystem::path& html, const std::filesystem::path& pdf) {
  const std::string program = installed();
  if (program.empty())
    return make_error(Errc::unsupported,
                      "the server prints it with Chromium, which is not installed (Debian: chromium); every "
                      "browser prints report.html");
  // Chromium's own sandbox starts neither for root nor in a service that may make no namespaces
  // (RestrictNamespaces=); the page is ours, and has no script.
  const bool sandboxed = ::geteuid() != 0;
  if (print(program, html, pdf, sandboxed) || (sandboxed && print(program, html, pdf, false)))
    return boost::outcome_v2::success();
  return make_error(Errc::internal,
                    program + " of the server did not print it; every browser prints report.html");
}

}  // namespace anchord::server
