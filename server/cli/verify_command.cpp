#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "api/formats/handover.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"

namespace anchord::cli {
namespace {

constexpr int k_differs = 1, k_unusable = 2;

int fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", printable(message).c_str());
  return k_unusable;
}

int verify(const std::string& pack, const std::string& key_file) {
  std::optional<Ed25519Public> key;
  if (!key_file.empty()) {
    std::ifstream in(key_file, std::ios::binary);
    const std::string pem{std::istreambuf_iterator<char>(in), {}};
    if (!in) return fail("cannot read " + key_file);
    auto parsed = Ed25519Public::parse_pem(pem);
    if (!parsed) return fail(key_file + ": " + parsed.error().message);
    key = std::move(parsed).value();
  }
  const auto verdict = api::verify_pack(pack, key);
  if (!verdict) return fail(pack + ": " + verdict.error().message);
  const auto& v = verdict.value();
  for (const auto& fault : v.faults) std::printf("differs: %s\n", printable(fault).c_str());
  if (!v.faults.empty()) return k_differs;
  std::printf("whole: %zu files are what the %s says\n", v.n_files,
              v.kind == api::PackVerdict::Kind::pack ? "list of checksums" : "manifest");
  if (v.kind == api::PackVerdict::Kind::bundle)
    std::printf("not signed: a flight bundle has no signature, a hand-over pack has\n");
  else if (v.own_key)
    std::printf(
        "signed with the key in the pack, %s: --key with the server's own (GET /api/v1/signing-key) "
        "proves whose it is\n",
        v.key_id.c_str());
  else
    std::printf("signed with the key given, %s\n", v.key_id.c_str());
  return 0;
}

}  // namespace

void add_verify_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "verify", "Hold a hand-over pack or a flight bundle against its checksums and signature");
  const auto pack = std::make_shared<std::string>();
  const auto key = std::make_shared<std::string>();
  command->add_option("pack", *pack, "file to look at")->required();
  command->add_option("--key", *key, "public key of the server it comes from, PEM; else that in the pack");
  command->callback([&exit_code, pack, key] { exit_code = verify(*pack, *key); });
}

}  // namespace anchord::cli
