#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "api/formats/handover.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"

namespace anchord::cli {
namespace {

constexpr int k_differs = 1, k_unusable_pack = 2;

int unusable(const std::string& message) {
  std::fprintf(stderr, "%s\n", printable(message).c_str());
  return k_unusable_pack;
}

int verify(const std::string& pack, const std::string& key_file) {
  std::optional<Ed25519Public> key;
  if (!key_file.empty()) {
    std::ifstream in(key_file, std::ios::binary);
    const std::string pem{std::istreambuf_iterator<char>(in), {}};
    if (!in) return unusable("cannot read " + key_file);
    auto parsed = Ed25519Public::parse_pem(pem);
    if (!parsed) return unusable(key_file + ": " + parsed.error().message);
    key = std::move(parsed).value();
  }
  const auto verdict = api::verify_pack(pack, key);
  if (!verdict) return unusable(pack + ": " + verdict.error().message);
  const auto& v = verdict.value();
  for (const auto& fault : v.faults) std::printf("differs: %s\n", printable(fault).c_str());
  if (!v.faults.empty()) return k_differs;
  std::printf("intact: %zu files match the %s\n", v.n_files,
              v.kind == api::PackVerdict::Kind::pack ? "list of checksums" : "manifest");
  if (v.kind == api::PackVerdict::Kind::bundle)
    std::printf("not signed: only a hand-over pack has a signature, a bundle has none\n");
  else if (v.own_key)
    std::printf(
        "signed with the key in the pack, %s: to prove which server signed, give its key with --key (GET "
        "/api/v1/signing-key)\n",
        printable(v.key_id).c_str());
  else
    std::printf("signed with the key given, %s\n", printable(v.key_id).c_str());
  return 0;
}

}  // namespace

void add_verify_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "verify",
      "Check a hand-over pack, or a bundle of a flight or a site, against its checksums and signature");
  const auto pack = std::make_shared<std::string>();
  const auto key = std::make_shared<std::string>();
  command->add_option("pack", *pack, "file to check")->required();
  command->add_option("--key", *key, "public key of the server it comes from, PEM [that in the pack]");
  command->callback([&exit_code, pack, key] { exit_code = verify(*pack, *key); });
}

}  // namespace anchord::cli
