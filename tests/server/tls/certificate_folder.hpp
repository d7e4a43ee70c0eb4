#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "server/tls/certificate_maker.hpp"
#include "server/tls/tls_keeper.hpp"

namespace anchord::test {

/// A folder with an authority and a server certificate of its own; goes with it.
class CertificateFolder {
 public:
  explicit CertificateFolder(const std::string& name) {
    std::string pattern = (std::filesystem::temp_directory_path() / "anchord tls XXXXXX").string();
    path = mkdtemp(pattern.data());
    authority_ = server::make_authority(SystemClock{}.now()).value();
    std::ofstream(ca()) << authority_.certificate;
    make(name, SystemClock{}.now(), 100);
  }
  ~CertificateFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  CertificateFolder(const CertificateFolder&) = delete;
  CertificateFolder& operator=(const CertificateFolder&) = delete;

  /// Another certificate in the same files, by the same authority.
  void make(const std::string& name, UtcTime now, int days) const {
    const auto made =
        server::make_server_certificate(authority_, {{name, "localhost", "127.0.0.1"}, days}, now).value();
    std::ofstream(files().certificate) << made.certificate;
    std::ofstream(files().key) << made.key;
    std::filesystem::permissions(files().key, std::filesystem::perms(0600));
  }
  server::TlsFiles files() const { return {path / "server.pem", path / "server.key"}; }
  std::filesystem::path ca() const { return path / "ca.pem"; }
  static std::string text(const std::filesystem::path& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::filesystem::path path;

 private:
  server::PemPair authority_;
};

}  // namespace anchord::test
