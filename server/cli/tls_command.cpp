#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/runtime/private_file.hpp"
#include "server/tls/certificate_maker.hpp"
#include "server/tls/tls_keeper.hpp"

namespace anchord::cli {
namespace {

namespace fs = std::filesystem;
using server::PemPair;

struct TlsOptions {
  std::string data_dir{"anchord-data"}, dir;
  server::ServerNames wanted;
  bool force{false};
  fs::path folder() const { return dir.empty() ? fs::path(data_dir) / "tls" : fs::path(dir); }
};

constexpr std::string_view k_authority = "ca.pem", k_authority_key = "ca.key";
constexpr std::string_view k_certificate = "server.pem", k_key = "server.key";

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Keys are for the owner alone; certificates go to everybody who connects.
Result<void> write_pair(const fs::path& certificate, const fs::path& key, const PemPair& pair) {
  BOOST_OUTCOME_TRYV(server::write_private(key, pair.key));
  BOOST_OUTCOME_TRYV(server::write_private(certificate, pair.certificate));
  std::error_code error;
  fs::permissions(
      certificate,
      fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read | fs::perms::others_read, error);
  if (error) return make_error(Errc::storage_unavailable, certificate.string() + ": " + error.message());
  return boost::outcome_v2::success();
}

std::vector<std::string> names_of_this_machine() {
  std::array<char, 256> name{};
  std::vector<std::string> out;
  if (::gethostname(name.data(), name.size() - 1) == 0 && name.front() != '\0') out.emplace_back(name.data());
  return out;
}

/// Commands of the machine itself use these.
void add_loopback(std::vector<std::string>& names) {
  for (const char* own : {"localhost", "127.0.0.1", "::1"}) {
    if (std::ranges::find(names, own) == names.end()) names.emplace_back(own);
  }
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const auto& name : names) out.append(out.empty() ? "" : ", ").append(name);
  return out;
}

std::string full_path(const fs::path& path) {
  std::error_code ignored;
  return fs::absolute(path, ignored).lexically_normal().string();
}

int print_made(const fs::path& folder) {
  const auto facts = server::facts_of(text_of(folder / k_certificate), std::string(k_certificate));
  const auto authority = server::facts_of(text_of(folder / k_authority), std::string(k_authority));
  if (!facts || !authority) return failed("anchord", "cannot read what was written to " + folder.string());
  std::printf("certificate  %s\n  for        %s\n  until      %s\nauthority    %s\n  SHA-256    %s\n",
              full_path(folder / k_certificate).c_str(), printable(joined(facts.value().names)).c_str(),
              to_rfc3339(facts.value().not_after).c_str(), full_path(folder / k_authority).c_str(),
              authority.value().sha256.c_str());
  return 0;
}

void print_next_steps(const fs::path& folder) {
  const std::string ca = full_path(folder / k_authority);
  std::printf(
      "\nTo serve HTTPS:\n"
      "  anchord serve --listen 0.0.0.0:8443 --tls-certificate '%s' --tls-key '%s'\n"
      "Names other than loopback also go to --allowed-hosts.\n"
      "To trust it, copy %s (not the .key files) to each client and compare the SHA-256 there:\n"
      "  Debian    cp ca.pem /usr/local/share/ca-certificates/anchord.crt && update-ca-certificates\n"
      "  curl      curl --cacert ca.pem https://...      anchord   ANCHORD_CA_FILE=ca.pem\n"
      "  Firefox   Settings > Certificates > Authorities > Import\n"
      "  Android   Settings > Security > Encryption & credentials > Install a certificate > CA certificate\n"
      "  iOS       open the file, then Settings > General > VPN & Device Management, and > About > "
      "Certificate Trust\n"
      "  Windows   certutil -addstore Root ca.pem\n"
      "Keep ca.key where only you have access: whoever has it can impersonate any site to these clients.\n",
      full_path(folder / k_certificate).c_str(), full_path(folder / k_key).c_str(), ca.c_str());
}

int init(TlsOptions options) {
  const fs::path folder = options.folder();
  std::error_code error;
  for (const auto name : {k_authority, k_authority_key, k_certificate, k_key}) {
    if (options.force || !fs::exists(folder / name, error)) continue;
    return failed(
        "anchord",
        (folder / name).string() +
            " already exists: 'anchord tls renew' creates a new certificate that clients trust without a "
            "change; --force also replaces the authority, which every client must then be set to "
            "trust again",
        2);
  }
  if (options.wanted.names.empty()) options.wanted.names = names_of_this_machine();
  add_loopback(options.wanted.names);
  const auto now = SystemClock{}.now();
  const auto authority = server::make_authority(now);
  if (!authority) return failed("anchord", authority.error().message);
  const auto made = server::make_server_certificate(authority.value(), options.wanted, now);
  if (!made) return failed("anchord", made.error().message, 2);
  fs::create_directories(folder, error);
  if (error) return failed("anchord", "cannot make " + folder.string() + ": " + error.message());
  if (const auto written = write_pair(folder / k_authority, folder / k_authority_key, authority.value());
      !written)
    return failed("anchord", written.error().message);
  if (const auto written = write_pair(folder / k_certificate, folder / k_key, made.value()); !written)
    return failed("anchord", written.error().message);
  if (const int code = print_made(folder); code != 0) return code;
  print_next_steps(folder);
  return 0;
}

int renew(TlsOptions options) {
  const fs::path folder = options.folder();
  const PemPair authority{text_of(folder / k_authority), text_of(folder / k_authority_key)};
  if (authority.certificate.empty() || authority.key.empty())
    return failed("anchord",
                  "no authority (ca.pem and ca.key) in " + folder.string() +
                      ": 'anchord tls init' creates one; give another folder with --dir",
                  2);
  const auto former = server::facts_of(text_of(folder / k_certificate), (folder / k_certificate).string());
  if (options.wanted.names.empty()) {
    if (!former) return failed("anchord", former.error().message + "; give its names with --name", 2);
    options.wanted.names = former.value().names;
  }
  add_loopback(options.wanted.names);
  const auto made = server::make_server_certificate(authority, options.wanted, SystemClock{}.now());
  if (!made) return failed("anchord", made.error().message, 2);
  if (const auto written = write_pair(folder / k_certificate, folder / k_key, made.value()); !written)
    return failed("anchord", written.error().message);
  if (const int code = print_made(folder); code != 0) return code;
  std::vector<std::string> gone;
  if (former) {
    std::ranges::copy_if(former.value().names, std::back_inserter(gone), [&](const std::string& name) {
      return std::ranges::find(options.wanted.names, name) == options.wanted.names.end();
    });
  }
  if (!gone.empty())
    std::printf(
        "\nNo longer for %s: clients that use it will refuse this server. --name replaces the former names: "
        "give it for each one, or leave it out to keep them.\n",
        printable(joined(gone)).c_str());
  std::printf(
      "\nA running server loads it at SIGHUP (systemctl reload anchord). Clients already trust it.\n");
  return 0;
}

int show(const std::string& file) {
  const std::string text = text_of(file);
  const auto facts = server::facts_of(text, file);
  if (!facts) return failed("anchord", facts.error().message, 2);
  std::printf("for      %s\nfrom     %s\nuntil    %s\nSHA-256  %s\n",
              printable(joined(facts.value().names)).c_str(), to_rfc3339(facts.value().not_before).c_str(),
              to_rfc3339(facts.value().not_after).c_str(), facts.value().sha256.c_str());
  int code = 0;
  for (const auto& warning : server::tls_warnings(facts.value(), std::nullopt, SystemClock{}.now())) {
    std::printf("%s\n", printable(warning.text).c_str());
    if (warning.critical) code = 1;
  }
  return code;
}

}  // namespace

void add_tls_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("tls", "Create and show the certificate of a server without a public name");
  command->require_subcommand(1);
  const auto options = std::make_shared<TlsOptions>();
  const auto common = [&](CLI::App* sub) {
    sub->add_option("--data-dir", options->data_dir, "folder of the database [anchord-data]")
        ->envname("ANCHORD_DATA_DIR");
    sub->add_option("--dir", options->dir, "folder of the certificates [DATA_DIR/tls]");
    sub->add_option("--name", options->wanted.names,
                    "host name or address that clients use; repeat for each one");
    sub->add_option("--days", options->wanted.days,
                    "days for which the certificate is valid, at most 825 [397]");
  };
  auto* make = command->add_subcommand("init", "Create an authority and a certificate signed by it");
  common(make);
  make->add_flag("--force", options->force, "replace existing files, the authority too");
  make->callback([&exit_code, options] { exit_code = init(*options); });
  auto* again = command->add_subcommand("renew", "Create a new certificate with the existing authority");
  common(again);
  again->callback([&exit_code, options] { exit_code = renew(*options); });
  auto* print = command->add_subcommand("show", "Print names, dates and fingerprint of a certificate file");
  const auto file = std::make_shared<std::string>();
  print->add_option("file", *file, "PEM file")->required();
  print->callback([&exit_code, file] { exit_code = show(*file); });
}

}  // namespace anchord::cli
