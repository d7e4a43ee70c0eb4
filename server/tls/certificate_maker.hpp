#pragma once

#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord::server {

/// A certificate and its key, both PEM.
struct PemPair {
  std::string certificate, key;
};

/// What a server certificate is for.
struct ServerNames {
  std::vector<std::string> names;  ///< "anchord.local", "192.168.2.10", "::1"; the first is its common name
  int days{397};
};

/// A certificate authority of this installation alone (ECDSA P-256, ten years): what tablets are made to
/// trust. errors: internal (OpenSSL)
Result<PemPair> make_authority(UtcTime now);
/// A server's certificate signed by it, with a key of its own; `certificate` is the chain, the authority
/// last. errors: invalid_argument (a name, the days, an authority that cannot sign), internal
Result<PemPair> make_server_certificate(const PemPair& authority, const ServerNames& wanted, UtcTime now);

/// What a certificate says, for people.
struct CertificateFacts {
  std::vector<std::string> names;  ///< DNS names and addresses
  UtcTime not_before, not_after;
  std::string sha256;  ///< "9F:86:...", what browsers show
};
/// Of the first certificate of a PEM file. errors: invalid_argument
Result<CertificateFacts> facts_of(const std::string& pem, const std::string& called);

}  // namespace anchord::server
