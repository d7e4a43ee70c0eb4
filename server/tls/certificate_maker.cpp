#include "server/tls/certificate_maker.hpp"

#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/bn.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>

#include "core/base/text.hpp"
#include "server/tls/openssl.hpp"

namespace anchord::server {
namespace {

constexpr int k_authority_days = 3653;
constexpr int k_most_days = 825;  ///< iOS and macOS refuse longer ones, of private authorities too
constexpr std::int64_t k_day_s = 86'400;
/// Tablets in the field have clocks that are behind.
constexpr std::int64_t k_backdated_s = k_day_s;

struct NamesFree {
  void operator()(GENERAL_NAMES* names) const { GENERAL_NAMES_free(names); }
};
struct BignumFree {
  void operator()(BIGNUM* number) const { BN_free(number); }
};

Error openssl_error(const std::string& what) {
  return make_error(Errc::internal, what + ": " + take_openssl_error());
}

std::string text_of(BIO* bio) {
  char* bytes = nullptr;
  const long n = BIO_get_mem_data(bio, &bytes);
  return {bytes, static_cast<std::size_t>(std::max(n, 0L))};
}

bool set_time(ASN1_TIME* time, std::int64_t unix_s) { return ASN1_TIME_set(time, unix_s) != nullptr; }

/// 16 random bytes, positive: RFC 5280 wants unique serial numbers, at most 20 bytes.
bool set_serial(X509* certificate) {
  std::array<unsigned char, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) return false;
  bytes[0] = static_cast<unsigned char>((bytes[0] & 0x7f) | 0x40);
  const std::unique_ptr<BIGNUM, BignumFree> number(
      BN_bin2bn(bytes.data(), static_cast<int>(bytes.size()), nullptr));
  return number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)) != nullptr;
}

bool add_extension(X509* certificate, X509* issuer, int nid, const std::string& value) {
  X509V3_CTX context{};
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str());
  const bool added = extension != nullptr && X509_add_ext(certificate, extension, -1) == 1;
  X509_EXTENSION_free(extension);
  return added;
}

bool set_name(X509_NAME* name, const std::string& common_name) {
  const auto add = [name](const char* field, const std::string& text) {
    // No pointer casts: OpenSSL wants unsigned bytes.
    const std::vector<unsigned char> bytes(text.begin(), text.end());
    return X509_NAME_add_entry_by_txt(name, field, MBSTRING_UTF8, bytes.data(),
                                      static_cast<int>(bytes.size()), -1, 0) == 1;
  };
  // At most 64 characters (RFC 5280, ub-common-name); the full name is in the list of names.
  return add("O", "anchord") && add("CN", common_name.substr(0, 64));
}

bool is_address(const std::string& name) {
  std::array<unsigned char, 16> bytes{};
  return inet_pton(AF_INET, name.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, name.c_str(), bytes.data()) == 1;
}

/// A host name, or "*." and one. Also keeps commas and colons out of the list that OpenSSL parses.
bool is_dns_name(std::string_view name) {
  if (name.starts_with("*.")) name.remove_prefix(2);
  return !name.empty() && name.size() <= 253 && name.front() != '.' && name.back() != '.' &&
         std::ranges::all_of(name, [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' ||
                  c == '.' || c == '_';
         });
}

Result<PemPair> to_pem(X509* certificate, EVP_PKEY* key) {
  const Bio text(BIO_new(BIO_s_mem())), secret(BIO_new(BIO_s_mem()));
  if (PEM_write_bio_X509(text.get(), certificate) != 1 ||
      PEM_write_bio_PKCS8PrivateKey(secret.get(), key, nullptr, nullptr, 0, nullptr, nullptr) != 1)
    return openssl_error("cannot write the certificate as PEM");
  return PemPair{text_of(text.get()), text_of(secret.get())};
}

struct Wanted {
  std::string common_name;
  std::int64_t from_s{}, to_s{};
  std::vector<std::pair<int, std::string>> extensions;
};

/// `issuer` null: signed by itself.
Result<PemPair> make(const Wanted& wanted, X509* issuer, EVP_PKEY* issuer_key) {
  const PrivateKey key(EVP_EC_gen("P-256"));
  const Certificate made(X509_new());
  X509* const certificate = made.get();
  if (!key || !made) return openssl_error("cannot create a key");
  bool good = X509_set_version(certificate, X509_VERSION_3) == 1 && set_serial(certificate) &&
              set_time(X509_getm_notBefore(certificate), wanted.from_s) &&
              set_time(X509_getm_notAfter(certificate), wanted.to_s) &&
              set_name(X509_get_subject_name(certificate), wanted.common_name) &&
              X509_set_issuer_name(certificate,
                                   X509_get_subject_name(issuer == nullptr ? certificate : issuer)) == 1 &&
              X509_set_pubkey(certificate, key.get()) == 1;
  for (const auto& [nid, value] : wanted.extensions)
    good = good && add_extension(certificate, issuer == nullptr ? certificate : issuer, nid, value);
  good = good && X509_sign(certificate, issuer == nullptr ? key.get() : issuer_key, EVP_sha256()) > 0;
  if (!good) return openssl_error("cannot create the certificate of " + wanted.common_name);
  return to_pem(certificate, key.get());
}

std::string address_text(const ASN1_OCTET_STRING* bytes) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const int family = ASN1_STRING_length(bytes) == 4 ? AF_INET : AF_INET6;
  const char* got =
      inet_ntop(family, ASN1_STRING_get0_data(bytes), text.data(), static_cast<socklen_t>(text.size()));
  return got == nullptr ? std::string() : std::string(got);
}

std::vector<std::string> names_of(X509* certificate) {
  std::vector<std::string> out;
  const std::unique_ptr<GENERAL_NAMES, NamesFree> names(
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr)));
  for (int i = 0; names && i < sk_GENERAL_NAME_num(names.get()); ++i) {
    int kind = 0;
    const auto* value = static_cast<const ASN1_STRING*>(
        GENERAL_NAME_get0_value(sk_GENERAL_NAME_value(names.get(), i), &kind));
    if (kind == GEN_IPADD) out.push_back(address_text(value));
    if (kind != GEN_DNS) continue;
    const auto* bytes = ASN1_STRING_get0_data(value);
    out.push_back(to_utf8(std::string(bytes, bytes + ASN1_STRING_length(value)), 253));
  }
  return out;
}

UtcTime time_of(const ASN1_TIME* time) {
  std::tm utc{};
  if (ASN1_TIME_to_tm(time, &utc) != 1) return {};
  return {static_cast<std::int64_t>(timegm(&utc)) * 1'000'000'000};
}

}  // namespace

Result<PemPair> make_authority(UtcTime now) {
  const std::int64_t now_s = now.us() / 1'000'000;
  return make({"anchord authority of " + to_rfc3339(now).substr(0, 10),
               now_s - k_backdated_s,
               now_s + k_authority_days * k_day_s,
               {{NID_basic_constraints, "critical,CA:TRUE,pathlen:0"},
                {NID_key_usage, "critical,keyCertSign,cRLSign"},
                {NID_subject_key_identifier, "hash"}}},
              nullptr, nullptr);
}

Result<PemPair> make_server_certificate(const PemPair& authority, const ServerNames& wanted, UtcTime now) {
  if (wanted.names.empty())
    return make_error(Errc::invalid_argument, "a server certificate needs a name or address");
  if (wanted.days < 1 || wanted.days > k_most_days)
    return make_error(Errc::invalid_argument, std::to_string(wanted.days) + " days: must be 1 to " +
                                                  std::to_string(k_most_days) +
                                                  ", tablets do not accept longer ones");
  std::string names;
  for (const auto& name : wanted.names) {
    const bool address = is_address(name);
    if (!address && !is_dns_name(name))
      return make_error(Errc::invalid_argument, "'" + to_utf8(name, 80) + "' is not a host name or address");
    names.append(names.empty() ? "" : ",").append(address ? "IP:" : "DNS:").append(name);
  }
  BOOST_OUTCOME_TRY(const auto issuer, certificate_from_pem(authority.certificate, "the authority"));
  BOOST_OUTCOME_TRY(const auto issuer_key, key_from_pem(authority.key, "the authority's key"));
  if (X509_check_private_key(issuer.get(), issuer_key.get()) != 1 || X509_check_ca(issuer.get()) != 1) {
    take_openssl_error();
    return make_error(
        Errc::invalid_argument,
        "the authority cannot sign: its key belongs to another certificate, or it is not an authority");
  }
  const std::int64_t now_s = now.us() / 1'000'000;
  const std::int64_t end_s = time_of(X509_get0_notAfter(issuer.get())).us() / 1'000'000;
  if (end_s <= now_s)
    return make_error(Errc::invalid_argument,
                      "the authority has expired: create a new one with 'anchord tls init --force', and make "
                      "all clients trust it");
  BOOST_OUTCOME_TRY(auto made, make({wanted.names.front(),
                                     now_s - k_backdated_s,
                                     std::min(now_s + wanted.days * k_day_s, end_s),
                                     {{NID_basic_constraints, "critical,CA:FALSE"},
                                      {NID_key_usage, "critical,digitalSignature"},
                                      {NID_ext_key_usage, "serverAuth"},
                                      {NID_subject_key_identifier, "hash"},
                                      {NID_authority_key_identifier, "keyid:always"},
                                      {NID_subject_alt_name, names}}},
                                    issuer.get(), issuer_key.get()));
  made.certificate += authority.certificate;
  return made;
}

Result<CertificateFacts> facts_of(const std::string& pem, const std::string& called) {
  BOOST_OUTCOME_TRY(const auto certificate, certificate_from_pem(pem, called));
  CertificateFacts facts;
  facts.names = names_of(certificate.get());
  facts.not_before = time_of(X509_get0_notBefore(certificate.get()));
  facts.not_after = time_of(X509_get0_notAfter(certificate.get()));
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  if (X509_digest(certificate.get(), EVP_sha256(), digest.data(), &size) != 1) return openssl_error(called);
  for (unsigned i = 0; i < size; ++i) {
    std::array<char, 4> text{};
    std::snprintf(text.data(), text.size(), "%s%02X", i == 0 ? "" : ":", static_cast<unsigned>(digest.at(i)));
    facts.sha256 += text.data();
  }
  return facts;
}

}  // namespace anchord::server
