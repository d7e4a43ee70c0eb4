#include <CLI/CLI.hpp>
#include <cstdio>

#include "api/admin/access.hpp"
#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "core/ports/organization_store.hpp"
#include "core/ports/site_store.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/server_address.hpp"
#include "server/cli/terminal_text.hpp"
#include "server/http/http_client.hpp"
#include "server/runtime/logging.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/postgres_database.hpp"

namespace anchord::cli {
namespace {

struct TokenOptions {
  std::string data_dir{"anchord-data"}, database, url, name, expires, id, organization;
  std::vector<std::string> roles, sites;
  std::optional<std::uint32_t> requests_per_minute;
};

/// "365d", "12h", or a UTC time. Errors: invalid_argument.
Result<std::optional<UtcTime>> expiry(const std::string& text, UtcTime now) {
  if (text.empty()) return std::optional<UtcTime>{};
  const char unit = text.back();
  if (unit == 'd' || unit == 'h') {
    char* end = nullptr;
    const long n = std::strtol(text.c_str(), &end, 10);
    if (n < 1 || n > 100'000 || end != text.c_str() + text.size() - 1) {
      return make_error(Errc::invalid_argument,
                        "--expires " + text + ": like 365d, 12h or 2027-01-31T00:00:00Z");
    }
    return std::optional(UtcTime{now.ns + n * (unit == 'd' ? 86'400LL : 3'600LL) * 1'000'000'000LL});
  }
  BOOST_OUTCOME_TRY(const auto time, parse_rfc3339(text));
  return std::optional(time);
}

/// A running server owns the folder: ask it. Else open the folder ourselves.
int through_server(const TokenOptions& options, const std::string& url, std::string_view method,
                   const std::string& target, const std::string& body) {
  auto client = server::HttpClient::to(url);
  if (!client) return failed("anchord", client.error().message, 2);
  const std::string token = own_token(options.data_dir);
  if (!token.empty()) client.value().set_header("Authorization", "Bearer " + token);
  const auto answer = client.value().call(method, target, body);
  if (!answer) return failed("anchord", answer.error().message);
  if (answer.value().status >= 400) return failed("anchord", api::problem_text(answer.value().body));
  if (!answer.value().body.empty()) std::printf("%s\n", printable_json(answer.value().body).c_str());
  return 0;
}

std::optional<std::string> server_of(const TokenOptions& options) {
  if (!options.url.empty()) return options.url;
  const auto url = running_server(options.data_dir);
  if (!url) return std::nullopt;
  // The address may be left over from a crash.
  auto client = server::HttpClient::to(*url, std::chrono::seconds(2));
  if (!client || !client.value().call("GET", "/healthz")) return std::nullopt;
  return url;
}

template <class Act>
int with_folder(const TokenOptions& options, Act act) {
  StorageOptions storage;
  storage.data_dir = options.data_dir;
  const bool elsewhere = !options.database.empty() || !sql::postgres_of_folder(storage.data_dir).empty();
  if (!std::filesystem::exists(elsewhere ? storage.data_dir : storage.data_dir / "anchord.db"))
    return failed(
        "anchord",
        "there is no anchord database in " + options.data_dir +
            ": give its folder with --data-dir; 'anchord serve' creates a new one, with a first token",
        2);
  auto database = open_store(options.database, storage);
  if (!database) return failed("anchord", database.error().message);
  const SystemClock clock;
  api::AccessService access(database.value()->stores(), clock);
  if (const auto loaded = access.load(); !loaded) return failed("anchord", loaded.error().message);
  return act(access, *database.value());
}

/// Errors: invalid_argument where there is no such site.
Result<SiteSet> sites_of(const std::vector<std::string>& texts, SiteStore& known) {
  if (texts.empty()) return SiteSet{};
  std::vector<SiteId> sites;
  for (const auto& text : texts) {
    const auto id = parse_uuid(text);
    if (!id || !known.site(SiteId{id.value()}))
      return make_error(Errc::invalid_argument,
                        "--site " + text + ": there is no such site; the ids are in GET /api/v1/sites");
    sites.push_back(SiteId{id.value()});
  }
  return SiteSet::only(std::move(sites));
}

/// Errors: invalid_argument where there is no such site or organization.
Result<api::TokenBounds> bounds_of(const TokenOptions& options, const Stores& known) {
  api::TokenBounds out;
  BOOST_OUTCOME_TRY(out.sites, sites_of(options.sites, known.sites));
  out.requests_per_minute = options.requests_per_minute;
  if (options.organization.empty()) return out;
  const auto id = parse_uuid(options.organization);
  if (!id || !known.organizations.organization(OrganizationId{id.value()}))
    return make_error(Errc::invalid_argument, "--organization " + options.organization +
                                                  ": there is no such organization; the ids are in GET "
                                                  "/api/v1/organizations");
  out.organization = OrganizationId{id.value()};
  return out;
}

int create(const TokenOptions& options) {
  const auto expires = expiry(options.expires, SystemClock().now());
  if (!expires) return failed("anchord", expires.error().message, 2);
  if (const auto url = server_of(options)) {
    std::string roles;
    for (const auto& role : options.roles) roles += (roles.empty() ? "" : ",") + json_text(role);
    std::string body = R"({"name":)" + json_text(options.name) + R"(,"roles":[)" + roles + "]";
    std::string sites;
    for (const auto& site : options.sites) sites += (sites.empty() ? "" : ",") + json_text(site);
    if (!sites.empty()) body += R"(,"sites":[)" + sites + "]";
    if (!options.organization.empty()) body += R"(,"organization":)" + json_text(options.organization);
    if (options.requests_per_minute)
      body += R"(,"requests_per_minute":)" + std::to_string(*options.requests_per_minute);
    if (expires.value()) body += R"(,"expires_at":")" + to_rfc3339(*expires.value()) + "\"";
    return through_server(options, *url, "POST", "/api/v1/tokens", body + "}");
  }
  return with_folder(options, [&](api::AccessService& access, Database& database) {
    const api::Principal who{"command line", "command line", {}};
    const auto bounds = bounds_of(options, database.stores());
    if (!bounds) return failed("anchord", bounds.error().message, 2);
    const auto made =
        access.create_token(options.name, options.roles, expires.value(), who, "local", bounds.value());
    if (!made) return failed("anchord", made.error().message, 2);
    std::fprintf(stderr, "token %s, shown once:\n", to_string(made.value().token.id).c_str());
    std::printf("%s\n", made.value().text.c_str());
    return 0;
  });
}

int list(const TokenOptions& options) {
  if (const auto url = server_of(options)) return through_server(options, *url, "GET", "/api/v1/tokens", {});
  return with_folder(options, [](api::AccessService& access, Database&) {
    for (const auto& token : access.tokens()) {
      std::string roles;
      for (const auto& role : token.roles) roles += (roles.empty() ? "" : ",") + role;
      const std::string state = token.revoked   ? "revoked " + to_rfc3339(*token.revoked)
                                : token.expires ? "expires " + to_rfc3339(*token.expires)
                                                : "no expiry";
      std::string sites = "every site";
      if (token.organization) {
        sites = "organization " + to_string(*token.organization);
      } else if (const SiteList list = token.sites.sites()) {
        sites = "sites";
        for (const auto& id : *list) sites += ' ' + to_string(id);
      }
      if (token.requests_per_minute)
        sites += "  " + std::to_string(*token.requests_per_minute) + " requests a minute";
      std::printf("%s  %-20s  %s  %s  %s\n", to_string(token.id).c_str(), one_line(token.name).c_str(),
                  roles.c_str(), state.c_str(), sites.c_str());
    }
    return 0;
  });
}

int revoke(const TokenOptions& options) {
  const auto id = parse_uuid(options.id);
  if (!id) return failed("anchord", id.error().message, 2);
  if (const auto url = server_of(options)) {
    return through_server(options, *url, "DELETE", "/api/v1/tokens/" + options.id, {});
  }
  return with_folder(options, [&](api::AccessService& access, Database&) {
    const api::Principal who{"command line", "command line", {}};
    const auto done = access.revoke_token(TokenId{id.value()}, who, "local");
    return done ? 0 : failed("anchord", done.error().message);
  });
}

}  // namespace

void add_token_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("token", "Create, list and revoke access tokens");
  command->require_subcommand(1);
  const auto options = std::make_shared<TokenOptions>();
  const auto common = [&](CLI::App* sub) {
    sub->add_option("--data-dir", options->data_dir, "folder of the database [anchord-data]")
        ->envname("ANCHORD_DATA_DIR");
    add_database_option(*sub, options->database);
    sub->add_option("--url", options->url, "address of a running server (token in ANCHORD_TOKEN)");
  };
  auto* make = command->add_subcommand("create", "Create a token and print it, once");
  common(make);
  make->add_option("--name", options->name, "name: who or what the token is for")->required();
  make->add_option("--role", options->roles,
                   "viewer, integrator, gateway, engineer, operator, admin; may be repeated")
      ->required();
  make->add_option("--site", options->sites,
                   "id of a site that the token is bound to; may be repeated [every site]");
  make->add_option("--organization", options->organization,
                   "id of an organization whose sites, also those of later, it is bound to instead");
  make->add_option("--requests-per-minute", options->requests_per_minute,
                   "at most; measurements and commands are not counted [no limit of its own]");
  make->add_option("--expires", options->expires, "like 365d, 12h or 2027-01-31T00:00:00Z [never]");
  make->callback([&exit_code, options] { exit_code = create(*options); });
  auto* show = command->add_subcommand("list", "List tokens (without their secrets)");
  common(show);
  show->callback([&exit_code, options] { exit_code = list(*options); });
  auto* end = command->add_subcommand("revoke", "Revoke a token immediately");
  common(end);
  end->add_option("id", options->id, "id of the token")->required();
  end->callback([&exit_code, options] { exit_code = revoke(*options); });
}

}  // namespace anchord::cli
