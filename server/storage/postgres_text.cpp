#include "server/storage/postgres_text.hpp"

#include <algorithm>
#include <charconv>

namespace anchord::sql {
namespace {

constexpr std::string_view k_ifnull = "ifnull";
/// PostgreSQL takes no more.
constexpr int k_most_parameters = 65535;

bool of_a_name(char c) {
  return c == '_' || (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

/// Behind the string, quoted name or comment that begins at `at`; `at` where none does.
std::size_t behind_quoted(std::string_view sql, std::size_t at) {
  const char quote = sql[at];
  if (quote == '\'' || quote == '"') {
    // A doubled quote ends one string and begins the next, which is skipped as well.
    const auto end = sql.find(quote, at + 1);
    return end == std::string_view::npos ? sql.size() : end + 1;
  }
  if (sql.substr(at, 2) == "--") return std::min(sql.find('\n', at), sql.size());
  return at;
}

/// libpq decodes the names of parameters too.
std::string decoded(std::string_view text) {
  std::string out;
  for (std::size_t at = 0; at < text.size(); ++at) {
    int byte = 0;
    const char* const hex = text.data() + at + 1;
    if (text[at] == '%' && at + 2 < text.size() && std::from_chars(hex, hex + 2, byte, 16).ptr == hex + 2) {
      out += static_cast<char>(byte);
      at += 2;
    } else {
      out += text[at];
    }
  }
  return out;
}

bool is_ifnull(std::string_view sql, std::size_t at) {
  return sql.substr(at, k_ifnull.size()) == k_ifnull && (at == 0 || !of_a_name(sql[at - 1])) &&
         sql.substr(at + k_ifnull.size(), 1) == "(";
}

}  // namespace

PostgresText::PostgresText(std::string_view sql) {
  Piece piece;
  for (std::size_t at = 0; at < sql.size();) {
    if (const auto end = behind_quoted(sql, at); end > at) {
      piece.text += sql.substr(at, end - at);
      at = end;
      continue;
    }
    if (is_ifnull(sql, at)) {
      piece.text += "coalesce";
      at += k_ifnull.size();
      continue;
    }
    const char* const end = sql.data() + sql.size();
    const auto number = sql[at] == '?' ? std::from_chars(sql.data() + at + 1, end, piece.parameter)
                                       : std::from_chars_result{nullptr, std::errc::invalid_argument};
    if (number.ec != std::errc{} || piece.parameter < 1 || piece.parameter > k_most_parameters) {
      piece.parameter = 0;
      piece.text += sql[at++];
      continue;
    }
    parameters_ = std::max(parameters_, piece.parameter);
    at = static_cast<std::size_t>(number.ptr - sql.data());
    pieces_.push_back(std::move(piece));
    piece = {};
  }
  pieces_.push_back(std::move(piece));
  whole_ = with(Given(static_cast<std::size_t>(parameters_), true));
}

std::string PostgresText::with(const Given& given) const {
  std::string out;
  for (const Piece& piece : pieces_) {
    out += piece.text;
    if (piece.parameter == 0) continue;
    const auto index = static_cast<std::size_t>(piece.parameter - 1);
    out += index < given.size() && given[index] ? "$" + std::to_string(piece.parameter) : "NULL";
  }
  return out;
}

std::string shown_address(std::string_view address) {
  const auto scheme = address.find("://");
  if (scheme == std::string_view::npos) return "PostgreSQL";
  const auto prefix = address.substr(0, scheme + 3);
  const auto rest = address.substr(prefix.size());
  const auto query = std::min(rest.find('?'), rest.size());
  const auto at = rest.rfind('@');
  // An '@' behind the '?': where the password ends cannot be told, so nothing is shown.
  if (at != std::string_view::npos && at > query) return std::string(prefix) + "...";
  const auto begin = at == std::string_view::npos ? 0 : at + 1;
  return std::string(prefix) + std::string(rest.substr(begin, query - begin));
}

std::string address_fault(std::string_view address) {
  if (!address.starts_with("postgresql://") && !address.starts_with("postgres://"))
    return "this is not an address of PostgreSQL; write postgresql://user@host:5432/name";
  const auto rest = address.substr(address.find("://") + 3);
  const auto at = rest.rfind('@');
  const auto user = at == std::string_view::npos ? std::string_view{} : rest.substr(0, at);
  if (user.find(':') == std::string_view::npos && decoded(rest).find("password=") == std::string::npos)
    return {};
  return "it contains a password, which others could read; write the password to ~/.pgpass, or to a file "
         "given in PGPASSFILE";
}

}  // namespace anchord::sql
