#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "server/tls/certificate_maker.hpp"
#include "server/tls/openssl.hpp"
#include "server/tls/tls_keeper.hpp"
#include "tests/server/tls/certificate_folder.hpp"

namespace anchord::server::certificates_test {
namespace {

using test::CertificateFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr std::int64_t k_day_ns = 86'400'000'000'000;
const UtcTime k_now{1'790'000'000'000'000'000};  // 2026-09-21

UtcTime days_later(std::int64_t days) { return {k_now.ns + days * k_day_ns}; }

TEST(Certificates, AreSignedByTheirAuthorityForTheNamesAskedForAndNoOthers) {
  const auto authority = make_authority(k_now).value();
  const auto made =
      make_server_certificate(authority, {{"hangar.local", "192.168.2.10", "::1"}, 30}, k_now).value();
  const auto own = certificate_from_pem(made.certificate, "own").value();
  const auto signer = certificate_from_pem(authority.certificate, "authority").value();
  EXPECT_EQ(X509_verify(own.get(), X509_get0_pubkey(signer.get())), 1);
  EXPECT_EQ(X509_check_host(own.get(), "hangar.local", 0, 0, nullptr), 1);
  EXPECT_EQ(X509_check_ip_asc(own.get(), "192.168.2.10", 0), 1);
  EXPECT_EQ(X509_check_ip_asc(own.get(), "::1", 0), 1);
  EXPECT_EQ(X509_check_host(own.get(), "other.local", 0, 0, nullptr), 0);
  EXPECT_EQ(X509_check_ca(own.get()), 0);     // it can sign nothing
  EXPECT_EQ(X509_check_ca(signer.get()), 1);  // 1: by basic constraints
  const auto facts = facts_of(made.certificate, "own").value();
  EXPECT_THAT(facts.names, ElementsAre("hangar.local", "192.168.2.10", "::1"));
  EXPECT_EQ(facts.not_after.ns / k_day_ns, days_later(30).ns / k_day_ns);
  EXPECT_LT(facts.not_before, k_now);
  EXPECT_EQ(facts.sha256.size(), 32u * 3 - 1);
}

TEST(Certificates, AreRefusedForWordsThatAreNoNames) {
  const auto authority = make_authority(k_now).value();
  for (const char* name : {"", "a b", "x,DNS:evil.example", "DNS:x", ".local", "a\nb", "https://x"}) {
    const auto made = make_server_certificate(authority, {{name}, 30}, k_now);
    ASSERT_FALSE(made) << name;
    EXPECT_THAT(made.error().message, HasSubstr("not a host name or address")) << name;
  }
  EXPECT_FALSE(make_server_certificate(authority, {{}, 30}, k_now));
  EXPECT_FALSE(make_server_certificate(authority, {{"x"}, 0}, k_now));
  EXPECT_FALSE(make_server_certificate(authority, {{"x"}, 826}, k_now));  // the most that iOS takes is 825
}

TEST(Certificates, EndNoLaterThanTheirAuthority) {
  const auto authority = make_authority({k_now.ns - 3640 * k_day_ns}).value();  // ten years hold 3653 days
  const auto made = make_server_certificate(authority, {{"x"}, 397}, k_now).value();
  EXPECT_EQ(facts_of(made.certificate, "x").value().not_after,
            facts_of(authority.certificate, "a").value().not_after);
  const auto old = make_authority({k_now.ns - 3660 * k_day_ns}).value();
  const auto refused = make_server_certificate(old, {{"x"}, 397}, k_now);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("the authority has expired"));
}

TEST(Certificates, NeedTheKeyOfTheirAuthority) {
  auto authority = make_authority(k_now).value();
  authority.key = make_authority(k_now).value().key;
  EXPECT_FALSE(make_server_certificate(authority, {{"x"}, 30}, k_now));
}

TEST(TlsKeeper, SaysWhichFileIsWrongAndWhy) {
  const CertificateFolder folder("one.local");
  const auto error_of = [&](const TlsFiles& files) {
    const auto opened = TlsKeeper::open(files);
    return opened ? std::string("opened") : opened.error().message;
  };
  EXPECT_EQ(error_of(folder.files()), "opened");
  EXPECT_THAT(error_of({folder.path / "none.pem", folder.files().key}),
              HasSubstr("tls.certificate: cannot read"));
  EXPECT_THAT(error_of({folder.files().certificate, folder.path / "none.key"}),
              HasSubstr("tls.key: cannot read"));
  EXPECT_THAT(error_of({folder.path, folder.files().key}), HasSubstr("is no file"));
  std::ofstream(folder.path / "words.pem") << "not a certificate";
  EXPECT_THAT(error_of({folder.path / "words.pem", folder.files().key}), HasSubstr("no certificate in PEM"));
  const CertificateFolder other("two.local");
  EXPECT_THAT(error_of({folder.files().certificate, other.files().key}), HasSubstr("is not the key of"));
  std::filesystem::permissions(folder.files().key, std::filesystem::perms(0644));
  EXPECT_THAT(error_of(folder.files()), HasSubstr("chmod 600"));
}

TEST(TlsKeeper, RefusesAKeyWithAPassphraseInsteadOfAskingTheTerminal) {
  const CertificateFolder folder("one.local");
  const PrivateKey key(EVP_EC_gen("P-256"));
  std::FILE* out = std::fopen(folder.files().key.c_str(), "w");
  ASSERT_NE(out, nullptr);
  char secret[] = "secret";
  EXPECT_EQ(PEM_write_PKCS8PrivateKey(out, key.get(), EVP_aes_256_cbc(), secret, 6, nullptr, nullptr), 1);
  std::fclose(out);
  const auto opened = TlsKeeper::open(folder.files());
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error().message, HasSubstr("without a passphrase"));
}

TEST(TlsKeeper, KeepsTheFormerCertificateUntilAGoodOneCame) {
  const CertificateFolder folder("one.local");
  const auto keeper = TlsKeeper::open(folder.files()).value();
  const auto before = keeper->facts().sha256;
  const auto good = folder.text(folder.files().certificate);

  std::ofstream(folder.files().certificate) << good.substr(0, good.size() / 4);  // cut while it was copied
  EXPECT_FALSE(keeper->reload(SystemClock{}.now()));
  EXPECT_EQ(keeper->facts().sha256, before);
  ASSERT_TRUE(keeper->failure());
  EXPECT_THAT(*keeper->failure(), HasSubstr(folder.files().certificate.string()));

  folder.make("one.local", {SystemClock{}.now().ns - 60 * k_day_ns}, 30);  // expired a month ago
  const auto expired = keeper->reload(SystemClock{}.now());
  ASSERT_FALSE(expired);
  EXPECT_THAT(expired.error().message, HasSubstr("expired on"));
  EXPECT_EQ(keeper->facts().sha256, before);

  folder.make("two.local", SystemClock{}.now(), 30);
  EXPECT_TRUE(keeper->reload(SystemClock{}.now()));
  EXPECT_NE(keeper->facts().sha256, before);
  EXPECT_FALSE(keeper->failure());
}

TEST(TlsWarnings, BeginThirtyDaysBeforeTheEnd) {
  CertificateFacts facts;
  facts.names = {"hangar.local"};
  const auto ids = [&](std::int64_t days_left, std::optional<std::string> failure = std::nullopt) {
    facts.not_after = days_later(days_left);
    std::vector<std::string> out;
    for (const auto& warning : tls_warnings(facts, failure, k_now)) out.push_back(warning.id);
    return out;
  };
  EXPECT_THAT(ids(31), ElementsAre());
  EXPECT_THAT(ids(30), ElementsAre("tls.expires"));
  EXPECT_THAT(ids(1), ElementsAre("tls.expires"));
  EXPECT_THAT(ids(0), ElementsAre("tls.expired"));
  EXPECT_THAT(ids(100, "no file"), ElementsAre("tls.not_reloaded"));
  EXPECT_TRUE(tls_warnings(facts, std::nullopt, days_later(200)).front().critical);
}

}  // namespace
}  // namespace anchord::server::certificates_test
