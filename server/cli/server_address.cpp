#include "server/cli/server_address.hpp"

#include <cstdlib>
#include <fstream>

#include "server/app/app.hpp"
#include "server/http/http_client.hpp"

namespace anchord::cli {
namespace {

std::string first_line(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

}  // namespace

std::optional<std::string> running_server(const std::filesystem::path& data_dir) {
  auto line = first_line(data_dir / server::k_address_file);
  // Of anchord tls init; who named another authority knows better.
  const auto authority = data_dir / "tls" / "ca.pem";
  std::error_code ignored;
  if (line.starts_with("https://") && std::getenv("ANCHORD_CA_FILE") == nullptr &&
      std::filesystem::exists(authority, ignored))
    server::HttpClient::trust(authority.string());
  return line.empty() ? std::nullopt : std::optional(std::move(line));
}

std::string folder_token(const std::filesystem::path& data_dir) {
  return first_line(data_dir / server::k_admin_token_file);
}

std::string own_token(const std::filesystem::path& data_dir) {
  if (const char* given = std::getenv("ANCHORD_TOKEN")) return given;
  return folder_token(data_dir);
}

}  // namespace anchord::cli
