#include "server/tls/openssl.hpp"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

namespace anchord::server {
namespace {

Bio reader(std::string_view text) { return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size()))); }

/// A server has nobody who types a passphrase; OpenSSL's own would ask the terminal.
int no_passphrase(char*, int, int, void*) { return 0; }

}  // namespace

void free_bio(bio_st* bio) { BIO_free(bio); }
void free_certificate(x509_st* certificate) { X509_free(certificate); }
void free_key(evp_pkey_st* key) { EVP_PKEY_free(key); }

std::string take_openssl_error() {
  const unsigned long code = ERR_get_error();
  const char* reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  ERR_clear_error();
  return reason == nullptr ? "unknown reason" : reason;
}

Result<Certificate> certificate_from_pem(std::string_view pem, const std::string& called) {
  const auto bio = reader(pem);
  Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, no_passphrase, nullptr));
  if (!certificate)
    return make_error(Errc::invalid_argument,
                      called + ": no certificate in PEM (" + take_openssl_error() + ")");
  return certificate;
}

Result<PrivateKey> key_from_pem(std::string_view pem, const std::string& called) {
  const auto bio = reader(pem);
  PrivateKey key(PEM_read_bio_PrivateKey(bio.get(), nullptr, no_passphrase, nullptr));
  if (!key)
    return make_error(Errc::invalid_argument,
                      called + ": no private key in PEM without a passphrase (" + take_openssl_error() + ")");
  return key;
}

}  // namespace anchord::server
