// The ingest of a server that answers as docs/formats.md says, played by a script: which rows leave, which
// are rejected.
#include "server/gateway/delivery.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "server/gateway/row_lines.hpp"
#include "tests/scratch_dir.hpp"

namespace anchord::gateway::delivery_test {
namespace {

using Json = nlohmann::json;

const MissionId k_mission{parse_uuid("01890a5d-ac96-774b-bcce-b302099a8057").value()};

/// Stores lines by their text; "bad" ones are rejected, and at most `most_errors` of them are named.
struct ScriptedServer {
  std::set<std::string> stored;
  std::size_t most_errors{100}, most_bytes{1 << 20}, requests{0};
  int status{0};  ///< of every answer; 0: as the rows are

  Result<server::ClientResponse> operator()(std::string_view body) {
    ++requests;
    if (status != 0) return server::ClientResponse{status, {}, R"({"detail":"no"})"};
    if (body.size() > most_bytes) return server::ClientResponse{413, {}, "{}"};
    Json answer{{"accepted", 0}, {"duplicates", 0}, {"rejected", 0}, {"errors", Json::array()}};
    body.remove_prefix(header_of(Lines::ranges_csv).size());
    const auto count = [&](const char* what) { answer[what] = answer[what].get<int>() + 1; };
    for (int line = 2; !body.empty(); ++line) {
      const std::string row(body.substr(0, body.find('\n')));
      body.remove_prefix(row.size() + 1);
      if (row.starts_with("bad")) {
        count("rejected");
        if (answer["errors"].size() < most_errors)
          answer["errors"].push_back(
              {{"line", line}, {"code", "conflict"}, {"pointer", ""}, {"detail", "other"}});
      } else {
        count(stored.insert(row).second ? "accepted" : "duplicates");
      }
    }
    const bool none = answer["accepted"] == 0 && answer["duplicates"] == 0;
    return server::ClientResponse{none ? 422 : 200, {}, answer.dump()};
  }
};

class GatewayDelivery : public ::testing::Test {
 protected:
  /// n rows in batches of ten; every `bad`th is one that the server rejects.
  void keep(int n, int bad) {
    std::vector<Batch> batches;
    for (int i = 0; i < n; ++i) {
      if (i % 10 == 0) batches.push_back({{}, k_mission, Lines::ranges_csv, 0, {}, {}});
      batches.back().body += (bad > 0 && i % bad == 0 ? "bad" : "row") + std::to_string(i) + ",\n";
      ++batches.back().n_rows;
    }
    ASSERT_TRUE(outbox_->keep(std::move(batches)));
  }
  Assessment send() { return delivery_.send(outbox_->oldest(1 << 30, {}, 1 << 20).value()); }
  std::vector<Json> rejected() const {
    std::vector<Json> out;
    std::ifstream in(dir_.path() / "rejected.ndjson");
    for (std::string line; std::getline(in, line);) out.push_back(Json::parse(line));
    return out;
  }

  ScratchDir dir_;
  std::unique_ptr<Outbox> outbox_{Outbox::open(dir_.path(), 64u << 20).value()};
  RejectedFile rejected_file_{dir_.path()};
  SystemClock clock_;
  ScriptedServer server_;
  Delivery delivery_{*outbox_, rejected_file_, clock_,
                     [this](const auto&, auto, const auto& body) { return server_(body); }};
};

TEST_F(GatewayDelivery, WritesRejectedRowsDownWithTheirReasonAndNeverSendsThemAgain) {
  keep(30, 10);
  ASSERT_EQ(send().then, Then::settled);
  EXPECT_EQ(server_.stored.size(), 27u);
  const auto lines = rejected();
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[1]["row"]["t_us"], "bad10");
  EXPECT_EQ(lines[1]["code"], "conflict");
  EXPECT_EQ(lines[1]["mission"], to_string(k_mission));
  const auto state = outbox_->state();
  EXPECT_EQ(state.rows, 0u);
  EXPECT_EQ(state.totals.rejected, 3u);
  EXPECT_EQ(state.totals.accepted, 27u);
}

TEST_F(GatewayDelivery, FindsEveryRejectedRowWhereTheServerNamesOnlySomeAndCountsEachOnce) {
  server_.most_errors = 7;
  keep(400, 3);
  ASSERT_EQ(send().then, Then::settled);
  EXPECT_EQ(server_.stored.size(), 266u);
  std::set<std::string> named;
  for (const auto& line : rejected()) named.insert(line["row"]["t_us"]);
  EXPECT_EQ(named.size(), 134u);
  EXPECT_EQ(rejected().size(), 134u);
  const auto totals = outbox_->state().totals;
  EXPECT_EQ(totals.accepted, 266u);
  EXPECT_EQ(totals.duplicates, 0u);
  EXPECT_EQ(totals.rejected, 134u);
}

TEST_F(GatewayDelivery, HalvesABodyThatIsTooLargeAndRejectsARowThatIsTooLargeAlone) {
  server_.most_bytes = header_of(Lines::ranges_csv).size() + 60;
  keep(40, 0);
  ASSERT_TRUE(outbox_->keep({{{}, k_mission, Lines::ranges_csv, 1, {}, std::string(200, '7') + "\n"}}));
  ASSERT_EQ(send().then, Then::settled);
  EXPECT_EQ(server_.stored.size(), 40u);
  ASSERT_EQ(rejected().size(), 1u);
  EXPECT_EQ(outbox_->state().rows, 0u);
}

TEST_F(GatewayDelivery, KeepsEveryRowWhateverElseTheServerAnswers) {
  keep(20, 0);
  for (const int status : {400, 401, 403, 404, 410, 429, 500, 503, 507}) {
    server_.status = status;
    EXPECT_NE(send().then, Then::settled) << status;
    EXPECT_EQ(outbox_->state().rows, 20u) << status;
  }
  EXPECT_TRUE(rejected().empty());
  server_.status = 0;
  EXPECT_EQ(send().then, Then::settled);
  EXPECT_EQ(server_.stored.size(), 20u);
}

TEST(GatewayBatches, GroupsByMissionAndKindWithFixesFirst) {
  const MissionId other = unassigned();
  std::vector<Batch> batches{{1, k_mission, Lines::ranges_csv, 1, {}, "1"},
                             {2, k_mission, Lines::fixes_csv, 1, {}, "2"},
                             {3, other, Lines::ranges_csv, 1, {}, "3"},
                             {4, k_mission, Lines::ranges_csv, 1, {}, "4"}};
  const auto groups = grouped(std::move(batches));
  ASSERT_EQ(groups.size(), 3u);
  EXPECT_EQ(groups[0][0].id, 2);
  ASSERT_EQ(groups[1].size(), 2u);
  EXPECT_EQ(groups[1][0].id, 1);
  EXPECT_EQ(groups[1][1].id, 4);
}

}  // namespace
}  // namespace anchord::gateway::delivery_test
