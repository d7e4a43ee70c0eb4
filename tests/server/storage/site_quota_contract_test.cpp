// What a site may store, over every backend: asked where something new begins, never of a flight that has
// begun.
#include "core/ports/anchor_store.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/site_store.hpp"
#include "tests/server/storage/backends.hpp"
#include "tests/server/storage/bundle_rows.hpp"

namespace anchord::site_quota_contract_test {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;

class SiteQuotaContract : public StoreContract {
 protected:
  void SetUp() override {
    StoreContract::SetUp();
    if (db_ != nullptr) site_ = stored_site("Hall 3");
  }
  Stores s() { return db_->stores(); }
  SiteId stored_site(const std::string& name) {
    Site site;
    site.id = SiteId{make_uuid_v7(k_noon)};
    site.name = name;
    EXPECT_TRUE(s().sites.insert(site));
    return site.id;
  }
  Mission of_site(std::optional<SiteId> site) {
    Mission m;
    m.id = MissionId{make_uuid_v7(k_noon)};
    m.site = site;
    m.created = k_noon;
    return m;
  }
  Mission recorded(int n_ranges = 0) {
    const Mission m = of_site(site_);
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
             std::optional<std::uint64_t> anchors) {
    ASSERT_TRUE(s().sites.set_limits(site_, {missions, measurements, anchors}));
  }
  SiteQuota quota() { return s().sites.quota(site_).value(); }
  template <class T>
  void expect_refused(const Result<T>& result, const std::string& limit) {
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::conflict);
    EXPECT_THAT(result.error().message,
                AllOf(HasSubstr("quota of site \"Hall 3\""), HasSubstr(to_string(site_)), HasSubstr(limit),
                      HasSubstr("/quota")));
  }

  SiteId site_{};
};

TEST_P(SiteQuotaContract, CountsWhatIsStored) {
  EXPECT_EQ(s().sites.quota(SiteId{make_uuid_v7(k_noon)}).error().code, Errc::not_found);
  EXPECT_EQ(s().sites.set_limits(SiteId{make_uuid_v7(k_noon)}, {}).error().code, Errc::not_found);
  EXPECT_EQ(quota().used, (SiteCounts{0, 0, 0}));
  EXPECT_EQ(quota().limits, SiteLimits{});
  const auto flight = recorded(7);
  recorded();
  ASSERT_TRUE(s().measurements.append_fixes({fix_at(flight.id, 1), fix_at(flight.id, 2)}, true));
  ASSERT_TRUE(s().missions.insert(of_site(stored_site("another"))));
  auto anchor = s().anchors.find_or_create(NetworkId{0x100}, k_noon).value();
  anchor.site = site_;
  ASSERT_TRUE(s().anchors.update(anchor, anchor.version));
  EXPECT_EQ(quota().used, (SiteCounts{2, 9, 1}));
  limit(5, std::nullopt, 1);
  EXPECT_EQ(quota().limits, (SiteLimits{5, std::nullopt, 1}));
  EXPECT_FALSE(quota().reached(QuotaKind::missions));
  EXPECT_FALSE(quota().reached(QuotaKind::measurements));
  EXPECT_TRUE(quota().reached(QuotaKind::anchors));
  limit(std::nullopt, 0, std::nullopt);
  EXPECT_EQ(quota().limits, (SiteLimits{std::nullopt, 0, std::nullopt})) << "replaced, not joined";
  reopen();
  EXPECT_EQ(quota().limits, (SiteLimits{std::nullopt, 0, std::nullopt}));
}

TEST_P(SiteQuotaContract, RefusesTheNextFlightAndNoRowOfOneThatHasBegun) {
  const auto flight = recorded(10);
  limit(std::nullopt, 10, std::nullopt);
  expect_refused(s().missions.insert(of_site(site_)), "10 measurements");
  EXPECT_TRUE(s().missions.insert(of_site(std::nullopt)));
  EXPECT_TRUE(s().missions.insert(of_site(stored_site("another"))));
  EXPECT_THAT(measure(flight.id, 10, 500), Each(RowOutcome::accepted)) << "in the air";
  ASSERT_TRUE(s().missions.finish(flight.id, k_noon));
  EXPECT_THAT(measure(flight.id, 500, 510), Each(RowOutcome::accepted)) << "late, after landing";
  EXPECT_EQ(quota().used[1], 510u);
  limit(std::nullopt, 511, std::nullopt);
  EXPECT_TRUE(s().missions.insert(of_site(site_))) << "room for one measurement: it may start";
}

TEST_P(SiteQuotaContract, CountsFlightsInTheBinUntilTheyAreRemoved) {
  const auto first = recorded(3);
  recorded();
  limit(2, std::nullopt, std::nullopt);
  expect_refused(s().missions.insert(of_site(site_)), "2 missions, with this there would be 3");
  ASSERT_TRUE(s().missions.finish(first.id, k_noon));
  ASSERT_TRUE(s().bin.put(first.id, k_noon, 0, "me"));
  expect_refused(s().missions.insert(of_site(site_)), "2 missions");
  ASSERT_TRUE(s().bin.empty(first.id));
  while (s().bin.remove_rows(100).value() > 0) {
  }
  EXPECT_EQ(quota().used, (SiteCounts{1, 0, 0}));
  EXPECT_TRUE(s().missions.insert(of_site(site_)));
}

TEST_P(SiteQuotaContract, RefusesWhatIsMovedIntoTheSite) {
  Mission elsewhere = of_site(std::nullopt);
  ASSERT_TRUE(s().missions.insert(elsewhere));
  measure(elsewhere.id, 0, 20);
  ASSERT_TRUE(s().missions.finish(elsewhere.id, k_noon));
  elsewhere = s().missions.mission(elsewhere.id).value();
  elsewhere.site = site_;
  limit(std::nullopt, 19, std::nullopt);
  expect_refused(s().missions.update(elsewhere), "19 measurements, with this there would be 20");
  limit(0, std::nullopt, 0);
  expect_refused(s().missions.update(elsewhere), "0 missions");
  auto anchor = s().anchors.find_or_create(NetworkId{0x100}, k_noon).value();
  anchor.site = site_;
  expect_refused(s().anchors.update(anchor, anchor.version), "0 anchors");
  limit(1, 20, 1);
  EXPECT_TRUE(s().missions.update(elsewhere));
  ASSERT_TRUE(s().anchors.update(anchor, anchor.version));
  // What is there already is edited on, however full the site is.
  limit(0, 0, 0);
  elsewhere.name = "renamed";
  EXPECT_TRUE(s().missions.update(elsewhere));
  anchor = s().anchors.anchor(anchor.id).value();
  anchor.name = "renamed";
  EXPECT_TRUE(s().anchors.update(anchor, anchor.version));
}

TEST_P(SiteQuotaContract, RefusesABundleAsAWholeAndTakesOneThatIsHere) {
  const auto flight = recorded(10);
  ASSERT_TRUE(s().missions.finish(flight.id, k_noon));
  BundleRows rows;
  ASSERT_TRUE(s().bundles.write_out(flight.id, rows));
  limit(0, 0, 0);
  const auto again = s().bundles.take_in(flight.id, rows);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_FALSE(again.value().added());
  // On another server, whose site has other limits.
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().sites.insert(s().sites.site(site_).value()));
  for (const SiteLimits& limits :
       {SiteLimits{0, std::nullopt, std::nullopt}, SiteLimits{std::nullopt, 9, std::nullopt}}) {
    ASSERT_TRUE(other->stores().sites.set_limits(site_, limits));
    expect_refused(other->stores().bundles.take_in(flight.id, rows),
                   limits[0] ? "0 missions" : "9 measurements");
    EXPECT_FALSE(other->stores().missions.mission(flight.id)) << "nothing of it stays";
  }
  ASSERT_TRUE(other->stores().sites.set_limits(site_, {1, 10, std::nullopt}));
  EXPECT_TRUE(other->stores().bundles.take_in(flight.id, rows));
}

INSTANTIATE_TEST_SUITE_P(Backends, SiteQuotaContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::site_quota_contract_test
