#include "server/storage/site_quota.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_organization_insert =
    "INSERT INTO organization (id, name, description, created_t_ns, version) VALUES (?1, ?2, ?3, ?4, ?5) ON "
    "CONFLICT DO NOTHING RETURNING version";
constexpr const char* k_organization_update =
    "UPDATE organization SET name = ?2, description = ?3, version = ?4 WHERE id = ?1 AND version = ?5 "
    "RETURNING version";
constexpr const char* k_organization_columns =
    "SELECT id, name, description, created_t_ns, version FROM organization ";
constexpr const char* k_organization_sites = "SELECT count(*) FROM site WHERE organization_id = ?1";
constexpr const char* k_tokens =
    "SELECT count(*) FROM token WHERE organization_id = ?1 AND revoked_t_ns IS NULL";
constexpr const char* k_organization_remove =
    "DELETE FROM organization WHERE id = ?1 AND version = ?2 RETURNING version";
constexpr const char* k_members =
    "SELECT organization_id, id FROM site WHERE organization_id IS NOT NULL ORDER BY organization_id, id";

Organization read_organization(Query& query) {
  Organization out;
  out.id = query.id<OrganizationId>();
  out.name = query.text();
  out.description = query.text();
  out.created = query.time();
  out.version = query.as<std::uint64_t>();
  return out;
}

std::optional<Organization> find_organization(Connection& c, const OrganizationId& id) {
  Query query(c, std::string(k_organization_columns) + "WHERE id = ?1");
  query << id;
  if (!query.step()) return std::nullopt;
  return read_organization(query);
}

std::int64_t count(Connection& c, const char* text, const OrganizationId& id) {
  Query query(c, text);
  query << id;
  return query.step() ? query.integer() : 0;
}

class SqlOrganizationStore final : public OrganizationStore {
 public:
  explicit SqlOrganizationStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Organization& organization) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_organization_insert);
      query << organization.id << organization.name << organization.description << organization.created
            << organization.version;
      if (query.returned()) return std::nullopt;
      return make_error(Errc::conflict, "organization " + to_string(organization.id) + " exists");
    });
  }
  Result<void> update(const Organization& organization, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_organization_update);
      query << organization.id << organization.name << organization.description << expected_version + 1
            << expected_version;
      if (query.returned()) return std::nullopt;
      return changed_or_absent(c, organization.id, expected_version);
    });
  }
  Result<Organization> organization(const OrganizationId& id) override {
    return read_value<Organization>(gate_, [&](Connection& c) -> Result<Organization> {
      auto found = find_organization(c, id);
      if (!found) return absent("organization", id);
      return *std::move(found);
    });
  }
  Result<std::vector<Organization>> organizations(std::size_t limit,
                                                  const std::optional<OrganizationId>& after) override {
    return read_value<std::vector<Organization>>(
        gate_, [&](Connection& c) -> Result<std::vector<Organization>> {
          Query query(c, std::string(k_organization_columns) + "WHERE id > ?1 ORDER BY id LIMIT ?2");
          query << after.value_or(OrganizationId{}) << row_limit(limit);
          std::vector<Organization> found;
          while (query.step()) found.push_back(read_organization(query));
          return found;
        });
  }
  Result<void> remove(const OrganizationId& id, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      const auto sites = count(c, k_organization_sites, id), tokens = count(c, k_tokens, id);
      if (sites > 0 || tokens > 0)
        return make_error(Errc::conflict,
                          "organization " + to_string(id) + " has " + std::to_string(sites) + " sites and " +
                              std::to_string(tokens) +
                              " tokens: delete its sites or give them to another organization (PATCH "
                              "/api/v1/sites/ID), and revoke its tokens");
      Query query(c, k_organization_remove);
      query << id << expected_version;
      if (query.returned()) return std::nullopt;
      return changed_or_absent(c, id, expected_version);
    });
  }

  Result<OrganizationQuota> quota(const OrganizationId& id) override {
    return read_value<OrganizationQuota>(gate_, [&](Connection& c) -> Result<OrganizationQuota> {
      if (auto missing = missing_organization(c, id)) return *std::move(missing);
      return read_quota(c, id);
    });
  }
  Result<OrganizationLimits> limits(const OrganizationId& id) override {
    return read_value<OrganizationLimits>(gate_, [&](Connection& c) -> Result<OrganizationLimits> {
      if (auto missing = missing_organization(c, id)) return *std::move(missing);
      return read_limits(c, id);
    });
  }
  Result<void> set_limits(const OrganizationId& id, const OrganizationLimits& limits) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto missing = missing_organization(c, id)) return missing;
      write_limits(c, id, limits);
      return std::nullopt;
    });
  }

  Result<std::vector<std::pair<OrganizationId, SiteId>>> members() override {
    using Members = std::vector<std::pair<OrganizationId, SiteId>>;
    return read_value<Members>(gate_, [&](Connection& c) -> Result<Members> {
      Query query(c, k_members);
      Members found;
      while (query.step()) {
        const auto organization = query.id<OrganizationId>();
        found.emplace_back(organization, query.id<SiteId>());
      }
      return found;
    });
  }

 private:
  static Error changed_or_absent(Connection& c, const OrganizationId& id, std::uint64_t expected_version) {
    const auto stored = find_organization(c, id);
    return stored ? moved_on("the organization", expected_version, stored->version)
                  : absent("organization", id);
  }
  Gate& gate_;
};

}  // namespace

std::optional<Error> missing_organization(Connection& connection,
                                          const std::optional<OrganizationId>& organization) {
  if (!organization || find_organization(connection, *organization)) return std::nullopt;
  return absent("organization", *organization);
}

std::unique_ptr<OrganizationStore> make_organization_store(Gate& gate) {
  return std::make_unique<SqlOrganizationStore>(gate);
}

}  // namespace anchord::sql
