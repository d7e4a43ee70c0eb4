#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"
#include "server/http/limits.hpp"

namespace anchord::server {

enum class OptionKind : std::uint8_t { text, flag, count, seconds, metres, days, list, choice, database };

/// One setting. The table of all of them is the only place that knows names, defaults and meaning.
struct Option {
  std::string_view key;  ///< of the TOML file: "listen", "http.max_connections"
  std::string_view default_value;
  std::string_view help;
  OptionKind kind{OptionKind::text};
  std::string_view choices{};  ///< "on|off"
  std::string flag() const;    ///< "--http-max-connections"
  std::string env() const;     ///< "ANCHORD_HTTP_MAX_CONNECTIONS"
};
std::span<const Option> options();

enum class Origin : std::uint8_t { standard, file, environment, flag };
inline constexpr auto k_origin_words = enum_table<Origin>({{"default", Origin::standard},
                                                           {"file", Origin::file},
                                                           {"environment", Origin::environment},
                                                           {"flag", Origin::flag}});
constexpr std::string_view to_string(Origin origin) { return k_origin_words.word(origin); }

/// Settings as gathered: flags over ANCHORD_* over the file over the defaults.
struct Config {
  struct Value {
    std::string text;
    Origin origin{Origin::standard};
  };
  std::map<std::string, Value, std::less<>> values;
  std::vector<std::string> warnings;  ///< unknown ANCHORD_* variables: they may belong to another tool

  const std::string& text(std::string_view key) const;
  bool flag(std::string_view key) const;
  std::size_t count(std::string_view key) const;
  std::chrono::milliseconds seconds(std::string_view key) const;
  double metres(std::string_view key) const;
  std::vector<std::string> list(std::string_view key) const;
};

/// flags: key -> text as given. file: a TOML file, or null. environment: "NAME=value" lines.
/// All that is wrong is told at once, one line each. Errors: invalid_argument; not_found (no such file).
Result<Config> load_config(const std::map<std::string, std::string>& flags,
                           const std::optional<std::filesystem::path>& file,
                           const std::vector<std::string>& environment);

HttpLimits http_limits(const Config& config);
WsLimits ws_limits(const Config& config);
std::vector<std::string> process_environment();

}  // namespace anchord::server
