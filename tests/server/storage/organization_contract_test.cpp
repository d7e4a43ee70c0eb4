// Organizations, their sites, tokens and quotas, over every backend.
#include "core/ports/anchor_store.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/organization_store.hpp"
#include "core/ports/site_store.hpp"
#include "core/ports/token_store.hpp"
#include "tests/server/storage/backends.hpp"
#include "tests/server/storage/bundle_rows.hpp"

namespace anchord::organization_contract_test {
namespace {

using testing::AllOf;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

class OrganizationContract : public StoreContract {
 protected:
  void SetUp() override {
    StoreContract::SetUp();
    if (db_ == nullptr) return;
    north_ = made("North");
    south_ = made("South");
  }
  Stores s() { return db_->stores(); }
  OrganizationId made(const std::string& name) {
    Organization out;
    out.id = OrganizationId{make_uuid_v7(k_noon)};
    out.name = name;
    out.description = "customer " + name;
    out.created = k_noon;
    EXPECT_TRUE(s().organizations.insert(out));
    return out.id;
  }
  static Site site_of(const std::optional<OrganizationId>& organization) {
    Site site;
    site.id = SiteId{make_uuid_v7(k_noon)};
    site.name = "Hall";
    site.organization = organization;
    site.created = k_noon;
    return site;
  }
  SiteId stored_site(const std::optional<OrganizationId>& organization) {
    const Site site = site_of(organization);
    EXPECT_TRUE(s().sites.insert(site));
    return site.id;
  }
  Result<void> moved(const SiteId& id, const std::optional<OrganizationId>& to) {
    Site site = s().sites.site(id).value();
    site.organization = to;
    return s().sites.update(site, site.version);
  }
  static Mission flight_at(const SiteId& site) {
    Mission m;
    m.id = MissionId{make_uuid_v7(k_noon)};
    m.site = site;
    m.created = k_noon;
    return m;
  }
  Mission recorded(const SiteId& site, int n_ranges) {
    Mission m = flight_at(site);
    EXPECT_TRUE(s().missions.insert(m));
    if (n_ranges > 0) {
      EXPECT_THAT(measure(m.id, 0, n_ranges), Each(RowOutcome::accepted));
    }
    return m;
  }
  std::vector<RowOutcome> measure(const MissionId& mission, int from, int until) {
    std::vector<Range> rows;
    for (int i = from; i < until; ++i) rows.push_back(range_at(mission, i));
    return s().measurements.append_ranges(std::move(rows), false).value();
  }
  void limit(std::optional<std::uint64_t> missions, std::optional<std::uint64_t> measurements,
             std::optional<std::uint64_t> anchors, std::optional<std::uint64_t> sites) {
    ASSERT_TRUE(s().organizations.set_limits(north_, {{missions, measurements, anchors, sites}, {}}));
  }
  template <class T>
  void expect_refused(const Result<T>& result, const std::string& limit) {
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::conflict);
    EXPECT_THAT(result.error().message,
                AllOf(HasSubstr("quota of organization \"North\""), HasSubstr(to_string(north_)),
                      HasSubstr(limit), HasSubstr("PUT /api/v1/organizations/")));
  }
  Token token_of(const OrganizationId& organization, char secret) {
    Token token;
    token.id = TokenId{make_uuid_v7(k_noon)};
    token.name = "crew";
    token.secret_sha256_hex = std::string(64, secret);
    token.roles = {"admin"};
    token.created = k_noon;
    token.organization = organization;
    token.requests_per_minute = 600;
    return token;
  }

  OrganizationId north_{}, south_{};
};

TEST_P(OrganizationContract, KeepsOrganizationsAndTheirVersions) {
  auto north = s().organizations.organization(north_).value();
  EXPECT_EQ(north.name, "North");
  EXPECT_EQ(north.description, "customer North");
  EXPECT_EQ(north.created, k_noon);
  EXPECT_EQ(s().organizations.insert(north).error().code, Errc::conflict);
  north.name = "North AG";
  ASSERT_TRUE(s().organizations.update(north, 1));
  EXPECT_EQ(s().organizations.update(north, 1).error().code, Errc::conflict) << "it moved on";
  reopen();
  EXPECT_EQ(s().organizations.organization(north_).value().name, "North AG");
  EXPECT_EQ(s().organizations.organization(north_).value().version, 2u);
  const OrganizationId nobody{make_uuid_v7(k_noon)};
  EXPECT_EQ(s().organizations.organization(nobody).error().code, Errc::not_found);
  EXPECT_EQ(s().organizations.quota(nobody).error().code, Errc::not_found);
  EXPECT_EQ(s().organizations.limits(nobody).error().code, Errc::not_found);
  EXPECT_EQ(s().organizations.set_limits(nobody, {}).error().code, Errc::not_found);
  EXPECT_EQ(s().organizations.remove(nobody, 1).error().code, Errc::not_found);
  const auto first = s().organizations.organizations(1, std::nullopt).value();
  ASSERT_EQ(first.size(), 1u);
  EXPECT_EQ(first[0].id, north_);
  const auto rest = s().organizations.organizations(10, north_).value();
  ASSERT_EQ(rest.size(), 1u);
  EXPECT_EQ(rest[0].id, south_);
}

TEST_P(OrganizationContract, ListsTheSitesOfEach) {
  const auto a = stored_site(north_), b = stored_site(north_), c = stored_site(south_), d = stored_site({});
  const auto of = [&](const std::optional<OrganizationId>& organization) {
    std::vector<SiteId> ids;
    const auto sites = s().sites.sites(10, std::nullopt, organization).value();
    for (const auto& site : sites) ids.push_back(site.id);
    return ids;
  };
  EXPECT_THAT(of(north_), ElementsAre(a, b));
  EXPECT_THAT(of(south_), ElementsAre(c));
  EXPECT_THAT(of(std::nullopt), ElementsAre(a, b, c, d));
  EXPECT_EQ(s().sites.sites(10, a, north_).value().size(), 1u);
  EXPECT_THAT(s().organizations.members().value(),
              ElementsAre(std::pair(north_, a), std::pair(north_, b), std::pair(south_, c)));
  ASSERT_TRUE(moved(b, south_));
  EXPECT_THAT(of(north_), ElementsAre(a));
  EXPECT_EQ(s().sites.site(b).value().organization, south_);
  ASSERT_TRUE(moved(b, std::nullopt));
  EXPECT_FALSE(s().sites.site(b).value().organization);
  const OrganizationId nobody{make_uuid_v7(k_noon)};
  EXPECT_EQ(moved(b, nobody).error().code, Errc::not_found);
  EXPECT_EQ(s().sites.insert(site_of(nobody)).error().code, Errc::not_found);
}

TEST_P(OrganizationContract, StaysWhileItHasSitesOrTokens) {
  const auto site = stored_site(north_);
  const Token token = token_of(north_, 'a');
  ASSERT_TRUE(s().tokens.insert(token));
  const auto refused = s().organizations.remove(north_, 1);
  EXPECT_EQ(refused.error().code, Errc::conflict);
  EXPECT_THAT(refused.error().message, HasSubstr("1 sites and 1 tokens"));
  ASSERT_TRUE(moved(site, south_));
  EXPECT_THAT(s().organizations.remove(north_, 1).error().message, HasSubstr("0 sites and 1 tokens"));
  ASSERT_TRUE(s().tokens.revoke(token.id, k_noon));
  limit(1, {}, {}, {});
  ASSERT_TRUE(s().organizations.remove(north_, 1));
  EXPECT_EQ(s().organizations.organization(north_).error().code, Errc::not_found);
  const auto kept = s().tokens.token(token.id).value();
  EXPECT_EQ(kept.organization, north_) << "bound for ever: to nothing, not to everything";
  EXPECT_FALSE(kept.sites.all());
}

TEST_P(OrganizationContract, KeepsWhatATokenIsBoundTo) {
  const Token token = token_of(north_, 'a');
  ASSERT_TRUE(s().tokens.insert(token));
  reopen();
  const auto found = s().tokens.token_by_secret(std::string(64, 'a')).value();
  EXPECT_EQ(found.organization, north_);
  EXPECT_EQ(found.requests_per_minute, 600u);
  ASSERT_FALSE(found.sites.all());
  EXPECT_TRUE(found.sites.sites()->empty()) << "whoever knows the sites of organizations gives them";
  Token other = token_of(OrganizationId{make_uuid_v7(k_noon)}, 'b');
  EXPECT_EQ(s().tokens.insert(other).error().code, Errc::not_found);
}

TEST_P(OrganizationContract, CountsWhatAllItsSitesStore) {
  const auto a = stored_site(north_), b = stored_site(north_), c = stored_site(south_);
  recorded(a, 7);
  const auto flight = recorded(b, 3);
  recorded(c, 50);
  ASSERT_TRUE(s().measurements.append_fixes({fix_at(flight.id, 1), fix_at(flight.id, 2)}, true));
  auto anchor = s().anchors.find_or_create(NetworkId{0x100}, k_noon).value();
  anchor.site = b;
  ASSERT_TRUE(s().anchors.update(anchor, anchor.version));
  EXPECT_EQ(s().organizations.quota(north_).value().used,
            (QuotaCounts<k_organization_quota_kinds>{2, 12, 1, 2}));
  OrganizationLimits limits{{5, std::nullopt, 1, 2}, 120};
  ASSERT_TRUE(s().organizations.set_limits(north_, limits));
  reopen();
  const auto quota = s().organizations.quota(north_).value();
  EXPECT_EQ(quota.limits, limits.stored);
  EXPECT_FALSE(quota.reached(QuotaKind::missions));
  EXPECT_TRUE(quota.reached(QuotaKind::anchors));
  EXPECT_TRUE(quota.reached(QuotaKind::sites));
  EXPECT_EQ(s().organizations.limits(north_).value().requests_per_minute, 120u);
  limits = {};
  ASSERT_TRUE(s().organizations.set_limits(north_, limits));
  EXPECT_FALSE(s().organizations.limits(north_).value().requests_per_minute) << "replaced, not joined";
}

TEST_P(OrganizationContract, RefusesTheNextFlightOfAnyOfItsSitesAndNoRowOfOneThatHasBegun) {
  const auto a = stored_site(north_), b = stored_site(north_), c = stored_site(south_);
  const auto flight = recorded(a, 10);
  limit({}, 10, {}, {});
  expect_refused(s().missions.insert(flight_at(b)), "10 measurements");
  EXPECT_TRUE(s().missions.insert(flight_at(c))) << "of another organization";
  EXPECT_THAT(measure(flight.id, 10, 500), Each(RowOutcome::accepted)) << "in the air";
  ASSERT_TRUE(s().missions.finish(flight.id, k_noon));
  EXPECT_THAT(measure(flight.id, 500, 510), Each(RowOutcome::accepted)) << "late, after landing";
  limit(2, {}, {}, {});
  EXPECT_TRUE(s().missions.insert(flight_at(b)));
  expect_refused(s().missions.insert(flight_at(a)), "2 missions, with this there would be 3");
}

TEST_P(OrganizationContract, HoldsBesideTheQuotaOfTheSite) {
  const auto a = stored_site(north_), b = stored_site(north_);
  ASSERT_TRUE(s().sites.set_limits(a, {1, {}, {}}));
  limit(3, {}, {}, {});
  recorded(a, 0);
  EXPECT_THAT(s().missions.insert(flight_at(a)).error().message, HasSubstr("quota of site \"Hall\""));
  recorded(b, 0);
  recorded(b, 0);
  ASSERT_TRUE(s().sites.set_limits(a, {9, {}, {}}));
  expect_refused(s().missions.insert(flight_at(a)), "3 missions");
}

TEST_P(OrganizationContract, RefusesSitesAndWhatTheyBringBeyondItsQuota) {
  const auto a = stored_site(north_), b = stored_site(south_);
  recorded(b, 20);
  limit({}, {}, {}, 1);
  expect_refused(s().sites.insert(site_of(north_)), "1 sites, with this there would be 2");
  expect_refused(moved(b, north_), "1 sites");
  EXPECT_EQ(s().sites.site(b).value().organization, south_);
  limit({}, 19, {}, {});
  expect_refused(moved(b, north_), "19 measurements, with this there would be 20");
  limit(1, 20, 0, 2);
  ASSERT_TRUE(moved(b, north_));
  // What is there is edited on, however full it is.
  limit(0, 0, 0, 0);
  Site renamed = s().sites.site(a).value();
  renamed.name = "renamed";
  EXPECT_TRUE(s().sites.update(renamed, renamed.version));
  EXPECT_TRUE(moved(b, south_)) << "out of it";
}

TEST_P(OrganizationContract, LetsWhatItHasMoveFromOneOfItsSitesToAnother) {
  const auto a = stored_site(north_), b = stored_site(north_), c = stored_site(south_);
  Mission flight = recorded(a, 5), other = recorded(c, 5);
  for (const auto* one : {&flight, &other}) ASSERT_TRUE(s().missions.finish(one->id, k_noon));
  auto anchor = s().anchors.find_or_create(NetworkId{0x100}, k_noon).value();
  anchor.site = a;
  ASSERT_TRUE(s().anchors.update(anchor, anchor.version));
  limit(1, 5, 1, 2);
  flight = s().missions.mission(flight.id).value();
  flight.site = b;
  EXPECT_TRUE(s().missions.update(flight));
  anchor = s().anchors.anchor(anchor.id).value();
  anchor.site = b;
  EXPECT_TRUE(s().anchors.update(anchor, anchor.version));
  other = s().missions.mission(other.id).value();
  other.site = a;
  expect_refused(s().missions.update(other), "1 missions");
}

// A bundle carries rows of a site, not whose it is here.
TEST_P(OrganizationContract, DoesNotLeaveWithABundleNorComeInWithOne) {
  const auto site = stored_site(north_);
  BundleRows rows;
  ASSERT_TRUE(s().bundles.write_site(site, rows));
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().bundles.take_site(site, rows));
  EXPECT_FALSE(other->stores().sites.site(site).value().organization);
  EXPECT_TRUE(other->stores().organizations.organizations(10, std::nullopt).value().empty());
  ASSERT_TRUE(s().bundles.take_site(site, rows)) << "back where it came from";
  EXPECT_EQ(s().sites.site(site).value().organization, north_);
}

INSTANTIATE_TEST_SUITE_P(Backends, OrganizationContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::organization_contract_test
