// Plans, exclusions, labels, filters of measurements and the outbox of webhooks, over every backend.
#include "core/ports/event_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/learning_store.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/procedure_log.hpp"
#include "core/ports/site_store.hpp"
#include "core/ports/webhook_store.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::flight_contract_test {
namespace {

using testing::ElementsAre;
using testing::Pair;

class FlightStoreContract : public StoreContract {
 protected:
  PlanStore& plans() { return db_->stores().plans; }
  ExclusionStore& exclusions() { return db_->stores().exclusions; }
  EventStore& events() { return db_->stores().events; }
  WebhookStore& webhooks() { return db_->stores().webhooks; }

  StoredPlan plan(const std::string& name) {
    return {
        PlanId{make_uuid_v7(k_noon)}, name, {}, Document{"{\"name\":\"" + name + "\"}"}, k_noon, k_noon, 1};
  }
  /// A mission with n ranges of four anchors, 10 ms apart.
  Mission mission_with(int n) {
    const Mission m = stored_mission();
    std::vector<Range> rows;
    for (int i = 0; i < n; ++i) rows.push_back(range_at(m.id, i));
    EXPECT_TRUE(db_->stores().measurements.append_ranges(rows, true));
    return m;
  }
  Exclusion exclusion_of(const Mission& mission) {
    Exclusion e;
    e.id = ExclusionId{make_uuid_v7(k_noon)};
    e.mission = mission.id;
    e.reason = "reflections";
    e.by = "anna";
    e.created = k_noon;
    return e;
  }
  Webhook stored_webhook(const std::string& name) {
    Webhook w;
    w.id = WebhookId{make_uuid_v7(k_noon)};
    w.name = name;
    w.url = "https://example.org/" + name;
    w.secret = "whsec_x";
    w.events = {"revision.published", "alarm.raised"};
    w.created = k_noon;
    EXPECT_TRUE(webhooks().insert(w));
    return w;
  }
  WebhookDelivery delivery(const Webhook& to, std::int64_t due_ran_ns) {
    WebhookDelivery d;
    d.id = DeliveryId{make_uuid_v7(k_noon)};
    d.webhook = to.id;
    d.event = "alarm.raised";
    d.body = Document{"{}"};
    d.created = k_noon;
    d.due_ran_ns = due_ran_ns;
    return d;
  }
};

TEST_P(FlightStoreContract, ListsPlansNewestFirstAndKeepsVersions) {
  StoredPlan first = plan("first");
  const StoredPlan second = plan("second");
  ASSERT_TRUE(plans().insert(first));
  ASSERT_TRUE(plans().insert(second));
  EXPECT_EQ(plans().insert(first).error().code, Errc::conflict);
  const auto all = plans().plans(10, std::nullopt).value();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].id, second.id);
  EXPECT_EQ(plans().plans(10, second.id).value().at(0).id, first.id);
  first.name = "renamed";
  ASSERT_TRUE(plans().update(first, 1));
  EXPECT_EQ(plans().update(first, 1).error().code, Errc::conflict);
  EXPECT_EQ(plans().plan(first.id).value().name, "renamed");
  EXPECT_EQ(plans().plan(first.id).value().version, 2u);
  EXPECT_EQ(plans().remove(first.id, 1).error().code, Errc::conflict);
  ASSERT_TRUE(plans().remove(first.id, 2));
  EXPECT_EQ(plans().plan(first.id).error().code, Errc::not_found);
  first.site = SiteId{make_uuid_v7(k_noon)};
  EXPECT_EQ(plans().insert(first).error().code, Errc::not_found);
}

TEST_P(FlightStoreContract, KeepsTheNewestStateOfAProcedureUntilItIsForgotten) {
  const Mission m = stored_mission();
  ASSERT_TRUE(plans().keep_procedure(m.id, "{\"step\":1}", k_noon));
  ASSERT_TRUE(plans().keep_procedure(m.id, "{\"step\":2}", k_noon));
  EXPECT_THAT(plans().procedures().value(), ElementsAre(Pair(m.id, "{\"step\":2}")));
  EXPECT_EQ(plans().procedure(m.id).value(), "{\"step\":2}");
  EXPECT_EQ(plans().procedure(MissionId{}).value(), "") << "of another mission";
  ASSERT_TRUE(plans().keep_procedure(m.id, "", k_noon));
  EXPECT_TRUE(plans().procedures().value().empty());
  EXPECT_EQ(plans().procedure(m.id).value(), "");
  EXPECT_EQ(plans().keep_procedure(MissionId{}, "{}", k_noon).error().code, Errc::not_found);
}

TEST_P(FlightStoreContract, NumbersWhatAProcedureShowedAndGivesItBackInPages) {
  auto& log = db_->stores().procedure_log;
  const Mission m = stored_mission(), other = stored_mission();
  const auto entry = [](int i, std::string topic = "procedure") {
    return ProcedureEntry{UtcTime{k_noon.ns + i}, std::move(topic), "{\"i\":" + std::to_string(i) + "}"};
  };
  ASSERT_TRUE(log.append(m.id, std::vector{entry(1), entry(2, "mission.grid")}));
  ASSERT_TRUE(log.append(other.id, std::vector{entry(7)}));
  ASSERT_TRUE(log.append(m.id, std::vector{entry(3)}));
  ASSERT_TRUE(log.append(MissionId{}, std::vector{entry(4)})) << "its mission is gone: nothing to keep";
  const auto first = log.entries(m.id, 2, 0).value();
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].number, 1u);
  EXPECT_EQ(first[1].entry.topic, "mission.grid");
  EXPECT_EQ(first[1].entry.message_json, "{\"i\":2}");
  EXPECT_EQ(first[1].entry.time.ns, k_noon.ns + 2);
  const auto second = log.entries(m.id, 2, first[1].number).value();
  ASSERT_EQ(second.size(), 1u);
  EXPECT_EQ(second[0].entry.message_json, "{\"i\":3}");
  EXPECT_TRUE(log.entries(MissionId{}, 10, 0).value().empty());
}

TEST_P(FlightStoreContract, EndsAPageOfAProcedureBehindTheEntryThatExceedsIt) {
  auto& log = db_->stores().procedure_log;
  const Mission m = stored_mission();
  const std::string half = '"' + std::string(ProcedureLog::k_page_bytes / 2, 'x') + '"';
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(log.append(m.id, std::vector{ProcedureEntry{k_noon, "procedure", half}}));
  EXPECT_EQ(log.entries(m.id, 10, 0).value().size(), 2u);
  EXPECT_EQ(log.entries(m.id, 10, 2).value().size(), 1u);
}

TEST_P(FlightStoreContract, ExcludesASpanOfTimeOfAnAnchorAndTakesItBackOnce) {
  const Mission m = mission_with(12);
  Exclusion e = exclusion_of(m);
  e.selection.since = UtcTime{k_noon.ns + 20'000'000};
  e.selection.anchor = NetworkId{0x102};  // ranges 2, 6 and 10
  const auto made = exclusions().insert(e, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made.value().n_rows, 3u);
  const Exclusion::Included word{UtcTime{k_noon.ns + 1}, "bob", "they were right"};
  ASSERT_TRUE(exclusions().include(m.id, e.id, word));
  EXPECT_EQ(exclusions().include(m.id, e.id, word).error().code, Errc::conflict);
  EXPECT_EQ(exclusions().include(m.id, ExclusionId{}, word).error().code, Errc::not_found);
  const auto all = exclusions().exclusions(m.id).value();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].included->reason, "they were right");
  EXPECT_EQ(all[0].selection.anchor, NetworkId{0x102});
  EXPECT_FALSE(all[0].selection.tag);
}

TEST_P(FlightStoreContract, ExcludesEachRowNamedOnce) {
  const Mission m = mission_with(4);
  MeasurementStore::Filter filter;
  filter.mission = m.id;
  const auto ids = db_->stores().measurements.ranges(filter).value().ids;
  const Exclusion e = exclusion_of(m);
  const auto made = exclusions().insert(e, {ids[1], ids[3], ids[1]});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made.value().n_rows, 2u);
  EXPECT_EQ(exclusions().exclusions(m.id).value().at(0).selection.rows, made.value().selection.rows);
  Exclusion other = exclusion_of(m);
  EXPECT_EQ(exclusions().insert(other, {ids[0], 999'999}).error().code, Errc::not_found);
  EXPECT_EQ(exclusions().exclusions(m.id).value().size(), 1u);
}

TEST_P(FlightStoreContract, LabelsWhatIsGivenAndKeepsTheRest) {
  const Mission m = mission_with(8);
  auto& labels = db_->stores().labels;
  EXPECT_EQ(labels.label({m.id, NetworkId{0x101}, {}, {}, {}}, {4.25, std::nullopt}).value(), 2u);
  EXPECT_EQ(
      labels.label({m.id, {}, NetworkId{0x6e01}, {}, UtcTime{k_noon.ns + 40'000'000}}, {{}, false}).value(),
      4u);
  EXPECT_EQ(labels.label({MissionId{}, {}, {}, {}, {}}, {1.0, true}).error().code, Errc::not_found);
  MeasurementStore::Filter filter;
  filter.mission = m.id;
  const auto rows = db_->stores().measurements.ranges(filter).value().rows;
  ASSERT_EQ(rows.size(), 8u);
  EXPECT_EQ(rows[1].truth->distance_m, 4.25);
  EXPECT_EQ(rows[1].truth->los, false);
  EXPECT_EQ(rows[5].truth->distance_m, 4.25);
  EXPECT_FALSE(rows[5].truth->los);
  EXPECT_FALSE(rows[6].truth);
}

TEST_P(FlightStoreContract, FiltersRangesByDistanceLevelAndLabel) {
  const Mission m = stored_mission();
  std::vector<Range> rows;
  for (int i = 0; i < 6; ++i) {
    rows.push_back(range_at(m.id, i));
    rows.back().distance_m = i;
    if (i % 2 == 0) rows.back().rx_dbm = -80.0 - i;
    if (i == 5) rows.back().rss_dbm = -70.0;
    if (i == 3) rows.back().truth = RangeTruth{std::nullopt, true};
  }
  ASSERT_TRUE(db_->stores().measurements.append_ranges(rows, true));
  const auto count = [&](const MeasurementLimits& limits) {
    MeasurementStore::Filter filter;
    filter.mission = m.id;
    filter.limits = limits;
    const auto page = db_->stores().measurements.ranges(filter);
    EXPECT_TRUE(page) << page.error().message;
    EXPECT_EQ(page.value().rows.size(), db_->stores().measurements.count_ranges(filter).value());
    return page.value().rows.size();
  };
  using Label = MeasurementLimits::Label;
  EXPECT_EQ(count({2.0, 4.0, {}, {}, {}}), 3u);
  EXPECT_EQ(count({{}, {}, -82.0, {}, {}}), 3u);  // 0, 2, and by its own RSS 5
  EXPECT_EQ(count({{}, {}, {}, -81.0, {}}), 2u);  // 2 and 4
  EXPECT_EQ(count({{}, {}, {}, {}, Label::los}), 1u);
  EXPECT_EQ(count({{}, {}, {}, {}, Label::nlos}), 0u);
  EXPECT_EQ(count({{}, {}, {}, {}, Label::none}), 5u);
}

TEST_P(FlightStoreContract, KeepsTheEventsOfAFlightInTheOrderInWhichTheyCame) {
  const Mission m = stored_mission(), other = stored_mission();
  const auto event = [&](const MissionId& mission, std::int64_t after_s, const std::string& text) {
    LiveEvent e;
    e.time = UtcTime{k_noon.ns + after_s * 1'000'000'000};
    e.id = EventId{make_uuid_v7(e.time)};
    e.level = EventLevel::warning;
    e.code = "procedure.hold";
    e.text = text;
    e.mission = mission;
    return e;
  };
  LiveEvent sent = event(m.id, 1, "to Z\u00fcrich \"2\"");
  sent.place = {51.25, -179.5, 7.125};
  // The clock was set back between the second and the third.
  const std::vector<LiveEvent> all{event(m.id, 0, "a"), sent, event(m.id, -60, "c"),
                                   event(other.id, 0, "of another"), event(MissionId{}, 0, "of none")};
  ASSERT_TRUE(events().append(all));
  ASSERT_TRUE(events().append(std::span(all).first(2))) << "what is there stays";
  const auto read = events().events(m.id, 10, std::nullopt, std::nullopt).value();
  ASSERT_EQ(read.size(), 3u);
  EXPECT_EQ(read[0].text, "c");
  EXPECT_EQ(read[1].text, sent.text);
  EXPECT_EQ(read[1].id, sent.id);
  EXPECT_EQ(read[1].time, sent.time);
  EXPECT_EQ(read[1].level, EventLevel::warning);
  EXPECT_EQ(read[1].code, sent.code);
  EXPECT_EQ(read[1].mission, m.id);
  ASSERT_TRUE(read[1].place);
  EXPECT_EQ(read[1].place->lat_deg, 51.25);
  EXPECT_EQ(read[1].place->lon_deg, -179.5);
  EXPECT_EQ(read[1].place->height_above_ground_m, 7.125);
  EXPECT_FALSE(read[2].place);
  EXPECT_EQ(events().events(m.id, 1, std::nullopt, read[0].id).value().at(0).text, sent.text);
  EXPECT_TRUE(events().events(m.id, 10, std::nullopt, all[3].id).value().empty()) << "of another flight";
  EXPECT_EQ(events().events(m.id, 10, k_noon, std::nullopt).value().size(), 2u);
  EXPECT_TRUE(events().events(MissionId{}, 10, std::nullopt, std::nullopt).value().empty());
}

TEST_P(FlightStoreContract, KeepsWebhooksInOrderAndTheirVersions) {
  Webhook first = stored_webhook("first");
  const Webhook second = stored_webhook("second");
  const auto all = webhooks().webhooks().value();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].id, first.id);
  EXPECT_EQ(all[0].events, first.events);
  first.enabled = false;
  ASSERT_TRUE(webhooks().update(first, 1));
  EXPECT_EQ(webhooks().update(first, 1).error().code, Errc::conflict);
  EXPECT_FALSE(webhooks().webhook(first.id).value().enabled);
  ASSERT_TRUE(webhooks().remove(first.id));
  EXPECT_EQ(webhooks().remove(first.id).error().code, Errc::not_found);
  EXPECT_EQ(webhooks().update(first, 2).error().code, Errc::not_found);
  EXPECT_EQ(webhooks().webhook(second.id).value().name, "second");
}

TEST_P(FlightStoreContract, GivesPendingDeliveriesOfEnabledWebhooksTheFirstDueFirst) {
  const Webhook on = stored_webhook("on");
  Webhook off = stored_webhook("off");
  off.enabled = false;
  ASSERT_TRUE(webhooks().update(off, 1));
  WebhookDelivery late = delivery(on, 900);
  const WebhookDelivery soon = delivery(on, 100);
  Webhook gone;
  gone.id = WebhookId{make_uuid_v7(k_noon)};
  ASSERT_TRUE(webhooks().add({late, soon, delivery(off, 1), delivery(gone, 1)}));
  auto pending = webhooks().pending(on.id, 10).value();
  ASSERT_EQ(pending.size(), 2u);
  EXPECT_EQ(pending[0].id, soon.id);
  EXPECT_FALSE(pending[0].tried);
  late.state = DeliveryState::failed;
  late.attempts = 3;
  late.tried = UtcTime{k_noon.ns + 5};
  late.status = 503;
  late.fault = "busy";
  ASSERT_TRUE(webhooks().record(late));
  EXPECT_EQ(webhooks().pending(on.id, 10).value().size(), 1u);
  EXPECT_TRUE(webhooks().pending(off.id, 10).value().empty());
  const auto log = webhooks().deliveries(on.id, 10, std::nullopt).value();
  ASSERT_EQ(log.size(), 2u);
  EXPECT_EQ(log[0].id, soon.id);
  EXPECT_EQ(log[1].status, 503);
  EXPECT_EQ(log[1].fault, "busy");
  EXPECT_EQ(webhooks().deliveries(on.id, 10, soon.id).value().at(0).id, late.id);
  ASSERT_TRUE(webhooks().remove(on.id));
  EXPECT_TRUE(webhooks().deliveries(on.id, 10, std::nullopt).value().empty());
}

TEST_P(FlightStoreContract, ForgetsTheOldestDeliveriesOfAWebhook) {
  const Webhook to = stored_webhook("to");
  std::vector<WebhookDelivery> all;
  for (std::size_t i = 0; i < WebhookStore::k_kept_deliveries + 3; ++i) all.push_back(delivery(to, 1));
  ASSERT_TRUE(webhooks().add(all));
  const auto kept = webhooks().deliveries(to.id, 10'000, std::nullopt).value();
  ASSERT_EQ(kept.size(), WebhookStore::k_kept_deliveries);
  EXPECT_EQ(kept.front().id, all.back().id);
  EXPECT_EQ(kept.back().id, all[3].id);
}

INSTANTIATE_TEST_SUITE_P(Backends, FlightStoreContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::flight_contract_test
