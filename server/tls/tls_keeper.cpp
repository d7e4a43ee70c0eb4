#include "server/tls/tls_keeper.hpp"

#include <openssl/ssl.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "server/tls/openssl.hpp"

namespace anchord::server {
namespace {

constexpr std::int64_t k_warn_ns = 30LL * 86'400 * 1'000'000'000;
/// No certificate is as long; a device named by mistake has no end.
constexpr std::size_t k_most_bytes = 1 << 20;

Result<std::string> read_text(const std::filesystem::path& file, const std::string& setting) {
  std::ifstream in(file, std::ios::binary);
  std::error_code ignored;
  if (!in || !std::filesystem::is_regular_file(file, ignored)) {
    const std::string why = in ? "is no file" : std::strerror(errno);
    return make_error(Errc::not_found, setting + ": cannot read " + file.string() + ": " + why +
                                           "; 'anchord tls init' creates one");
  }
  std::string text(k_most_bytes, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text;
}

Result<void> keep_from_others(const std::filesystem::path& key) {
  struct stat state {};
  if (::stat(key.c_str(), &state) == 0 && (state.st_mode & (S_IROTH | S_IWOTH)) != 0)
    return make_error(Errc::invalid_argument,
                      "tls.key: every user of this machine may read " + key.string() + ": chmod 600 it");
  return boost::outcome_v2::success();
}

/// Every certificate of the file, the server's first.
Result<void> use_chain(SSL_CTX* context, const std::string& pem, const std::string& called) {
  BOOST_OUTCOME_TRY(const auto own, certificate_from_pem(pem, called));
  if (SSL_CTX_use_certificate(context, own.get()) != 1)
    return make_error(Errc::invalid_argument, called + ": " + take_openssl_error());
  constexpr std::string_view k_begin = "-----BEGIN CERTIFICATE-----";
  for (auto at = pem.find(k_begin, pem.find(k_begin) + 1); at != std::string::npos;
       at = pem.find(k_begin, at + 1)) {
    BOOST_OUTCOME_TRY(const auto signer, certificate_from_pem(std::string_view(pem).substr(at), called));
    if (SSL_CTX_add1_chain_cert(context, signer.get()) != 1)
      return make_error(Errc::invalid_argument, called + ": " + take_openssl_error());
  }
  return boost::outcome_v2::success();
}

std::string day(UtcTime time) { return to_rfc3339(time).substr(0, 10); }

std::string first_name(const CertificateFacts& facts) {
  return facts.names.empty() ? "the server" : facts.names.front();
}

}  // namespace

Result<TlsKeeper::Served> TlsKeeper::read(const TlsFiles& files) {
  BOOST_OUTCOME_TRY(const auto chain, read_text(files.certificate, "tls.certificate"));
  BOOST_OUTCOME_TRY(const auto secret, read_text(files.key, "tls.key"));
  BOOST_OUTCOME_TRYV(keep_from_others(files.key));
  const std::string called = "tls.certificate: " + files.certificate.string();
  Served served;
  BOOST_OUTCOME_TRY(served.facts, facts_of(chain, called));
  served.context = std::shared_ptr<ssl_ctx_st>(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  SSL_CTX* const context = served.context.get();
  if (context == nullptr) return make_error(Errc::internal, "TLS: " + take_openssl_error());
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  // A client that asks for another key exchange in an open connection costs us much and itself nothing.
  SSL_CTX_set_options(context,
                      SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE);
  SSL_CTX_set_cipher_list(context, "ECDHE+AESGCM:ECDHE+CHACHA20");  // of TLS 1.2; those of 1.3 are all good
  SSL_CTX_set_mode(context, SSL_MODE_RELEASE_BUFFERS);              // an idle connection holds 34 KiB less
  BOOST_OUTCOME_TRYV(use_chain(context, chain, called));
  BOOST_OUTCOME_TRY(const auto key, key_from_pem(secret, "tls.key: " + files.key.string()));
  if (SSL_CTX_use_PrivateKey(context, key.get()) != 1 || SSL_CTX_check_private_key(context) != 1) {
    take_openssl_error();
    return make_error(Errc::invalid_argument, "tls.key: " + files.key.string() + " is not the key of " +
                                                  files.certificate.string() +
                                                  ": give the key that belongs to this certificate");
  }
  return served;
}

Result<std::shared_ptr<TlsKeeper>> TlsKeeper::open(TlsFiles files) {
  BOOST_OUTCOME_TRY(auto served, read(files));
  return std::shared_ptr<TlsKeeper>(new TlsKeeper(std::move(files), std::move(served)));
}

Result<void> TlsKeeper::reload(UtcTime now) {
  auto fresh = read(files_);
  if (fresh && fresh.value().facts.not_after <= now)
    fresh = make_error(Errc::invalid_argument, "tls.certificate: " + files_.certificate.string() +
                                                   " expired on " + day(fresh.value().facts.not_after));
  if (!fresh) {
    const auto served = served_.lock();
    served->failure = fresh.error().message;
    return fresh.error();
  }
  served_.exchange(std::move(fresh).value());
  return boost::outcome_v2::success();
}

ssl_st* TlsKeeper::begin() const {
  const auto context = served_.copy().context;
  return SSL_new(context.get());
}

CertificateFacts TlsKeeper::facts() const { return served_.copy().facts; }
std::optional<std::string> TlsKeeper::failure() const { return served_.copy().failure; }

std::vector<TlsWarning> tls_warnings(const CertificateFacts& facts, const std::optional<std::string>& failure,
                                     UtcTime now) {
  std::vector<TlsWarning> out;
  const std::string how =
      ": replace it ('anchord tls renew' if it was created with anchord), then send SIGHUP or run systemctl "
      "reload anchord";
  if (facts.not_after <= now)
    out.push_back(
        {"tls.expired",
         "The TLS certificate of " + first_name(facts) + " expired on " + day(facts.not_after) + how, true});
  else if (facts.not_after.ns - now.ns <= k_warn_ns)
    out.push_back({"tls.expires", "The TLS certificate of " + first_name(facts) + " expires on " +
                                      day(facts.not_after) + how});
  if (failure)
    out.push_back({"tls.not_reloaded",
                   "The new TLS certificate was rejected, the previous one is still served: " + *failure});
  return out;
}

}  // namespace anchord::server
