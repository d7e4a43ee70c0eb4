#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "server/tls/certificate_maker.hpp"

struct ssl_ctx_st;
struct ssl_st;

namespace anchord::server {

struct TlsFiles {
  std::filesystem::path certificate;  ///< PEM: the server's first, then those that sign it
  std::filesystem::path key;          ///< PEM, no passphrase, not for others to read
};

/// Certificate and key of the listeners. They can be exchanged while connections run: each keeps what it
/// began with. TLS 1.2 and newer, forward secrecy only. Thread-safe.
class TlsKeeper {
 public:
  /// errors: not_found (a file), invalid_argument (not PEM, the key of another certificate, a key everybody
  /// may read)
  static Result<std::shared_ptr<TlsKeeper>> open(TlsFiles files);

  /// Reads the files again. What cannot be served, or has expired, is refused: the former certificate stays,
  /// and failure() says why until a reload succeeds.
  Result<void> reload(UtcTime now);

  /// State of one new connection, the server's side; the caller owns it.
  ssl_st* begin() const;

  CertificateFacts facts() const;
  std::optional<std::string> failure() const;

 private:
  struct Served {
    std::shared_ptr<ssl_ctx_st> context;
    CertificateFacts facts;
    std::optional<std::string> failure;
  };
  TlsKeeper(TlsFiles files, Served served) : files_(std::move(files)), served_(std::move(served)) {}
  static Result<Served> read(const TlsFiles& files);

  const TlsFiles files_;
  Locked<Served> served_;
};

/// What to tell people about a certificate: it ends soon, has ended, or could not be exchanged. Pairs of the
/// alarm's id and its text, which has no running numbers.
struct TlsWarning {
  std::string id, text;
  bool critical{false};
};
std::vector<TlsWarning> tls_warnings(const CertificateFacts& facts, const std::optional<std::string>& failure,
                                     UtcTime now);

}  // namespace anchord::server
