#include <atomic>
#include <thread>

#include "core/ports/learning_store.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::learning_contract_test {
namespace {

class LearningStoreContract : public StoreContract {
 protected:
  CampaignRecord stored_campaign(const std::string& name = "hall A") {
    CampaignRecord c;
    c.id = CampaignId{make_uuid_v7(k_noon)};
    c.name = name;
    c.created = k_noon;
    EXPECT_TRUE(db_->stores().campaigns.insert(c));
    return c;
  }
  DatasetRecord stored_dataset() {
    DatasetRecord d;
    d.id = DatasetId{make_uuid_v7(k_noon)};
    d.name = "may";
    d.query = d.report = {"{}"};
    d.digest = "00";
    d.n_train = 12;
    d.created = k_noon;
    EXPECT_TRUE(db_->stores().datasets.insert(d, "range_m\n1\n"));
    return d;
  }
  TrainingRun stored_run(const DatasetRecord& d) {
    TrainingRun r;
    r.id = TrainingRunId{make_uuid_v7(k_noon)};
    r.dataset = d.id;
    r.task = "nlos_id";
    r.request = {"{}"};
    r.created = k_noon;
    EXPECT_TRUE(db_->stores().training_runs.insert(r));
    return r;
  }
  StoredModel model_of(const std::optional<TrainingRunId>& run) {
    StoredModel m;
    m.id = ModelId{make_uuid_v7(k_noon)};
    m.task = "nlos_id";
    m.method = "logistic";
    m.run = run;
    m.manifest = {"{}"};
    m.created = k_noon;
    return m;
  }
  static CampaignRow row(const std::string& setting, double range_m, std::int64_t t_ns) {
    CampaignRow r;
    r.truth.setting = setting;
    r.truth.environment = "room 1";
    r.truth.distance_m = 5.0;
    r.truth.los = false;
    r.truth.material = "brick";
    r.truth.thickness_m = 0.2;
    r.sample.range_m = range_m;
    r.sample.time = UtcTime{t_ns};
    return r;
  }
};

TEST_P(LearningStoreContract, GivesBackACampaignsSettingsAndSamples) {
  const auto c = stored_campaign();
  auto with_cir = row("a", 5.4, 2);
  with_cir.sample.rx_dbm = -80.5;
  with_cir.sample.fp_amp2 = 7000;
  with_cir.sample.cir = Cir{{1, -2, 3, -4}, 1001.6, 744.2, 1001.0};
  const auto done =
      db_->stores().campaigns.append(c.id, {row("a", 5.2, 1), with_cir, row("b", 6, 1)}).value();
  EXPECT_EQ(done.accepted, 3u);
  const auto settings = db_->stores().campaigns.settings(c.id).value();
  ASSERT_EQ(settings.size(), 2u);
  EXPECT_EQ(settings[0].n_samples, 2u);
  EXPECT_NEAR(settings[0].mean_range_m, 5.3, 1e-12);
  EXPECT_NEAR(*settings[0].sd_range_m, 0.1 * std::sqrt(2.0), 1e-6);  // two values 0.2 apart
  EXPECT_EQ(settings[0].truth.material, "brick");
  EXPECT_EQ(settings[0].truth.los, false);
  EXPECT_FALSE(settings[1].sd_range_m);
  CampaignStore::Filter filter;
  filter.campaign = c.id;
  filter.setting = "a";
  filter.with_cir = true;
  const auto samples = db_->stores().campaigns.samples(filter).value();
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_FALSE(samples[0].has_cir);
  ASSERT_TRUE(samples[1].sample.cir);
  EXPECT_EQ(samples[1].sample.cir->re_im, (std::vector<std::int16_t>{1, -2, 3, -4}));
  EXPECT_EQ(samples[1].sample.rx_dbm, -80.5);
  EXPECT_EQ(samples[1].sample.fp_amp2, 7000);
  filter.after = samples[0].id;
  EXPECT_EQ(db_->stores().campaigns.samples(filter).value().size(), 1u);
  EXPECT_EQ(db_->stores().campaigns.sample(c.id, samples[1].id).value().sample.range_m, 5.4);
}

TEST_P(LearningStoreContract, FiltersSamplesByDistanceLevelAndLabel) {
  const auto c = stored_campaign();
  auto near = row("a", 5, 1), strong = row("a", 6, 2), open = row("b", 7, 3), untold = row("c", 8, 4);
  strong.sample.rx_dbm = -80;
  open.truth.los = true;
  untold.truth.los.reset();
  ASSERT_TRUE(db_->stores().campaigns.append(c.id, {near, strong, open, untold}));
  const auto found = [&](const MeasurementLimits& limits) {
    CampaignStore::Filter filter;
    filter.campaign = c.id;
    filter.limits = limits;
    std::vector<double> out;
    for (const auto page = db_->stores().campaigns.samples(filter); const auto& s : page.value())
      out.push_back(s.sample.range_m);
    return out;
  };
  using Label = MeasurementLimits::Label;
  EXPECT_EQ(found({6.0, 7.0, {}, {}, {}}), (std::vector<double>{6, 7}));
  EXPECT_EQ(found({{}, {}, -85.0, -75.0, {}}), std::vector<double>{6});
  EXPECT_EQ(found({{}, {}, {}, {}, Label::nlos}), (std::vector<double>{5, 6}));
  EXPECT_EQ(found({{}, {}, {}, {}, Label::los}), std::vector<double>{7});
  EXPECT_EQ(found({{}, {}, {}, {}, Label::none}), std::vector<double>{8});
}

TEST_P(LearningStoreContract, CountsARepeatedSampleAndRefusesAnotherTruthForASettingWhole) {
  const auto c = stored_campaign();
  ASSERT_TRUE(db_->stores().campaigns.append(c.id, {row("a", 5.2, 1)}));
  const auto would = db_->stores().campaigns.would_append(c.id, {row("a", 5.2, 1), row("a", 5.3, 2)}).value();
  EXPECT_EQ(would.accepted, 1u);
  EXPECT_EQ(would.duplicates, 1u);
  const auto again = db_->stores().campaigns.append(c.id, {row("a", 5.2, 1), row("a", 5.3, 2)}).value();
  EXPECT_EQ(again.accepted, 1u);
  EXPECT_EQ(again.duplicates, 1u);
  auto other = row("a", 5.5, 3);
  other.truth.distance_m = 6.0;
  EXPECT_EQ(db_->stores().campaigns.append(c.id, {row("a", 5.4, 4), other}).error().code, Errc::conflict);
  EXPECT_EQ(db_->stores().campaigns.settings(c.id).value()[0].n_samples, 2u);
}

TEST_P(LearningStoreContract, KnowsASampleByItsContentAndKeepsAnotherOfTheSameTime) {
  const auto c = stored_campaign();
  auto& campaigns = db_->stores().campaigns;
  const auto counts = [&](const std::vector<CampaignRow>& rows,
                          CampaignStore::Untimed untimed = CampaignStore::Untimed::known) {
    const auto done = campaigns.append(c.id, rows, untimed).value();
    return std::pair(done.accepted, done.duplicates);
  };
  using Counts = std::pair<std::size_t, std::size_t>;
  auto first = row("a", 5.2, 1'000'000);
  first.sample.rx_dbm = -80;
  first.sample.cir = Cir{{1, -2}, 1001.6, 744.2, 1001.0};
  first.sample.seq = 2;
  EXPECT_EQ(counts({first}), Counts(1, 0));
  // Told again by one that tells less (no level, no response, less than a microsecond off, another number).
  EXPECT_EQ(counts({row("a", 5.2, 1'000'900)}), Counts(0, 1));
  auto level = first, response = first;
  level.sample.rx_dbm = -81;
  response.sample.cir->re_im[0] = 7;
  EXPECT_EQ(counts({level, response, first, row("a", 5.3, 1'000'000)}), Counts(3, 1));
  EXPECT_EQ(counts({level, response, first, row("a", 5.3, 1'000'000)}), Counts(0, 4));
  // Without a time: as often as it is there, unless it is said to be new.
  auto still = row("b", 6, 0);
  still.sample.time.reset();
  EXPECT_EQ(counts({still, still}), Counts(2, 0));
  EXPECT_EQ(counts({still, still, still}), Counts(1, 2));
  EXPECT_EQ(counts({still}, CampaignStore::Untimed::fresh), Counts(1, 0));
  EXPECT_EQ(counts({row("b", 6, 0)}), Counts(1, 0)) << "one with a time is another";
  EXPECT_EQ(campaigns.settings(c.id).value()[1].n_samples, 5u);
}

TEST_P(LearningStoreContract, KeepsNamesOfCampaignsApartAndVersionsInOrder) {
  auto c = stored_campaign();
  CampaignRecord mirror = c;
  mirror.id = CampaignId{make_uuid_v7(k_noon)};
  EXPECT_EQ(db_->stores().campaigns.insert(mirror).error().code, Errc::conflict);
  c.note = "second day";
  ASSERT_TRUE(db_->stores().campaigns.update(c, 1));
  EXPECT_EQ(db_->stores().campaigns.update(c, 1).error().code, Errc::conflict);
  EXPECT_EQ(db_->stores().campaigns.campaign("hall A").value().version, 2u);
  ASSERT_TRUE(db_->stores().campaigns.append(c.id, {row("a", 5.2, 1)}));
  ASSERT_TRUE(db_->stores().campaigns.remove(c.id));
  EXPECT_EQ(db_->stores().campaigns.settings(c.id).error().code, Errc::not_found);
}

TEST_P(LearningStoreContract, KeepsADataSetThatATrainingRunUsed) {
  const auto d = stored_dataset();
  EXPECT_EQ(db_->stores().datasets.csv(d.id).value(), "range_m\n1\n");
  EXPECT_EQ(db_->stores().datasets.dataset("may").value().n_train, 12u);
  const auto r = stored_run(d);
  EXPECT_EQ(db_->stores().datasets.remove(d.id).error().code, Errc::conflict);
  ASSERT_TRUE(db_->stores().training_runs.remove(r.id));
  EXPECT_TRUE(db_->stores().datasets.remove(d.id));
  EXPECT_EQ(db_->stores().datasets.csv(d.id).error().code, Errc::not_found);
}

TEST_P(LearningStoreContract, FinishesARunWithItsPartsAndItsModelAtOnce) {
  const auto d = stored_dataset();
  const auto r = stored_run(d);
  EXPECT_EQ(db_->stores().training_runs.part(r.id, "folds").error().code, Errc::not_found);
  const auto m = model_of(r.id);
  ASSERT_TRUE(
      db_->stores().training_runs.finish(r.id, {"{\"a\":1}"}, {{"folds", "[]"}, {"grid", "[1]"}}, m, "{}"));
  EXPECT_EQ(db_->stores().training_runs.part(r.id, "grid").value(), "[1]");
  const auto found = db_->stores().training_runs.run(r.id).value();
  EXPECT_EQ(found.summary.text, "{\"a\":1}");
  EXPECT_EQ(found.model, m.id);
  EXPECT_EQ(db_->stores().models.model(m.id).value().run, r.id);
  EXPECT_EQ(db_->stores().models.artifact(m.id).value(), "{}");
  // A model outlives the record of its run.
  ASSERT_TRUE(db_->stores().training_runs.remove(r.id));
  EXPECT_FALSE(db_->stores().models.model(m.id).value().run);
  auto lost = model_of(std::nullopt);
  EXPECT_EQ(db_->stores().training_runs.finish(r.id, {"{}"}, {}, lost, "{}").error().code, Errc::not_found);
  EXPECT_EQ(db_->stores().models.model(lost.id).error().code, Errc::not_found);
}

TEST_P(LearningStoreContract, SaysWhichModelIsActiveAndKeepsTheHistory) {
  const auto a = model_of(std::nullopt), b = model_of(std::nullopt);
  ASSERT_TRUE(db_->stores().models.insert(a, "{}"));
  ASSERT_TRUE(db_->stores().models.insert(b, "{}"));
  EXPECT_TRUE(db_->stores().models.active().value().empty());
  EXPECT_EQ(db_->stores().models.promote({0, "nlos_id", a.id, "me", "", k_noon, false}).value().number, 1u);
  ASSERT_TRUE(db_->stores().models.promote({0, "nlos_id", b.id, "me", "better", k_noon, false}));
  ASSERT_EQ(db_->stores().models.active().value().size(), 1u);
  EXPECT_EQ(db_->stores().models.active().value()[0].model, b.id);
  ASSERT_TRUE(db_->stores().models.promote({0, "nlos_id", std::nullopt, "me", "none", k_noon, true}));
  EXPECT_FALSE(db_->stores().models.active().value()[0].model);
  EXPECT_EQ(db_->stores().models.promotions("nlos_id", 10).value().size(), 3u);
  EXPECT_EQ(db_->stores().models.promotions("", 2).value().size(), 2u);
  EXPECT_EQ(db_->stores().models.promote({0, "los_bias", b.id, "me", "", k_noon, false}).error().code,
            Errc::conflict);
  EXPECT_EQ(db_->stores().models.remove(b.id).error().code, Errc::conflict);
}

TEST_P(LearningStoreContract, OfEightPromotionsJudgedOnOneStateOneIsMade) {
  const auto a = model_of(std::nullopt);
  ASSERT_TRUE(db_->stores().models.insert(a, "{}"));
  std::atomic<int> made = 0, late = 0;
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 8; ++i) {
      threads.emplace_back([&] {
        const auto done = db_->stores().models.promote({0, "nlos_id", a.id, "me", "", k_noon, false}, 0);
        ++(done ? made : late);
        EXPECT_TRUE(done || done.error().code == Errc::conflict);
      });
    }
  }
  EXPECT_EQ(made, 1);
  EXPECT_EQ(late, 7);
  EXPECT_EQ(db_->stores().models.promotions("", 10).value().size(), 1u);
}

INSTANTIATE_TEST_SUITE_P(Backends, LearningStoreContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::learning_contract_test
