#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"
#include "server/cli/doctor.hpp"
#include "server/cli/terminal_text.hpp"

namespace anchord::cli {
namespace {

void print(const std::vector<Finding>& findings) {
  for (const auto& f : findings) {
    std::printf("%-8s %-14s %s\n", std::string(k_finding_words.word(f.level)).c_str(), f.what.c_str(),
                printable(f.seen).c_str());
    if (!f.advice.empty()) std::printf("%24s%s\n", "", printable(f.advice).c_str());
  }
}

}  // namespace

std::string findings_json(const std::vector<Finding>& findings) {
  auto out = nlohmann::ordered_json::array();
  for (const auto& f : findings)
    out.push_back(
        {{"level", k_finding_words.word(f.level)}, {"what", f.what}, {"seen", f.seen}, {"advice", f.advice}});
  return to_wire(out);
}

void add_doctor_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "doctor", "Check what a server needs: folder, disk, database, port, clock, devices; says what to do");
  const auto options = std::make_shared<DoctorOptions>();
  const auto json = std::make_shared<bool>(false);
  command->add_option("--data-dir", options->data_dir, "folder of the database [anchord-data]")
      ->envname("ANCHORD_DATA_DIR");
  add_database_option(*command, options->database);
  command->add_option("--listen", options->listen, "address on which a server would listen [127.0.0.1:8420]")
      ->envname("ANCHORD_LISTEN");
  command->add_option("--tls-certificate", options->tls_certificate, "PEM file of the server's certificate")
      ->envname("ANCHORD_TLS_CERTIFICATE");
  command->add_option("--tls-key", options->tls_key, "PEM file of its private key")
      ->envname("ANCHORD_TLS_KEY");
  command->add_flag("--json", *json, "print an array of {level, what, seen, advice}");
  command->callback([&exit_code, options, json] {
    const auto findings = examine(*options);
    if (*json)
      std::printf("%s\n", printable_json(findings_json(findings)).c_str());
    else
      print(findings);
    exit_code =
        std::ranges::any_of(findings, [](const auto& f) { return f.level == Finding::Level::failed; });
  });
}

}  // namespace anchord::cli
