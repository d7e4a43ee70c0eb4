#include "server/cli/top_screen.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/text.hpp"
#include "server/cli/text_table.hpp"

namespace anchord::test::top_screen_test {
namespace {

using Json = nlohmann::json;
using cli::columns_of;
using cli::cut_to;
using cli::one_line;
using cli::table_lines;
using cli::top_lines;

constexpr std::int64_t k_now_us = 1'777'889'472'000'000;  // 2026-05-04T10:11:12Z (date -d)
constexpr UtcTime k_now = UtcTime::from_us(k_now_us);

std::string list(const std::vector<Json>& items) {
  Json out{{"items", Json::array()}, {"next_cursor", nullptr}};
  for (const auto& item : items) out["items"].push_back(item);
  return out.dump();
}

Json device(const std::string& name) {
  return {{"id", "0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"},
          {"kind", "gnss"},
          {"name", name},
          {"address", "tcp://192.168.2.15:9001"},
          {"state", "talking"},
          {"reason", nullptr},
          {"conflict", nullptr},
          {"rate_hz", 5.04},
          {"last_seen_us", k_now_us - 2'300'000},
          {"dropped", {{"bad_checksum", 7}, {"too_old", 5}}}};
}

Json alarm(const std::string& text) {
  return {{"id", "rtk.float"}, {"priority", "warning"}, {"since_us", k_now_us - 42'000'000},
          {"text", text},      {"mission", nullptr},    {"acknowledged", false}};
}

/// A server with nothing to do.
cli::TopDocuments empty_server() {
  cli::TopDocuments out;
  out.version.body = R"({"version":"0.2.0","git":"7c6380c","schema":1,"api":"v1"})";
  out.ready.body = R"({"status":"ready","checks":{"db":"ok","disk":"ok","migrations":"ok"}})";
  out.system.body = Json{{"t_us", k_now_us},       {"recording", false}, {"queue_depth", 3},
                         {"db_bytes", 45'200'000}, {"ws_clients", 2},    {"disk_free_bytes", 12'340'000'000},
                         {"writable", true},       {"drone", nullptr}}
                        .dump();
  out.alarms.body = out.devices.body = out.missions.body = out.jobs.body = list({});
  out.metrics.body =
      "# HELP anchord_live_queue_rows Rows that are waiting for the live estimates\n"
      "# TYPE anchord_live_queue_rows gauge\n"
      "anchord_live_queue_rows 2\n"
      "anchord_command_queue 0\n"
      "anchord_ingest_lines_total{result=\"accepted\"} 4120\n"
      "anchord_ingest_lines_total{result=\"duplicate\"} 8\n"
      "anchord_ingest_lines_total{result=\"rejected\"} 31\n";
  return out;
}

cli::TopReading reading() { return {"http://127.0.0.1:8420", k_now, k_now, {}}; }

std::string joined(const std::vector<std::string>& lines) {
  std::string out;
  for (const auto& line : lines) out += line + "\n";
  return out;
}

std::string screen(const cli::TopDocuments& documents, cli::TopSize size = {}) {
  return joined(top_lines(documents, reading(), size));
}

/// The line that holds `word`; empty when none does.
std::string line_with(const std::string& text, const std::string& word) {
  const auto at = text.find(word);
  if (at == std::string::npos) return {};
  const auto begin = text.rfind('\n', at) + 1;
  return text.substr(begin, text.find('\n', at) - begin);
}

TEST(TopScreen, ShowsVersionHealthAndQueuesOfAServerWithNothingToDo) {
  const auto text = screen(empty_server());
  EXPECT_EQ(text.substr(0, text.find('\n')), "anchord 0.2.0 (7c6380c) at http://127.0.0.1:8420");
  EXPECT_NE(text.find("Read 2026-05-04 10:11:12 UTC\n"), std::string::npos) << text;
  EXPECT_NE(text.find("Health: READY\n"), std::string::npos) << text;
  EXPECT_NE(text.find("Recording: no   Live clients: 2   Database: 45.2 MB   Disk free: 12.3 GB\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("ALARMS\n  none\n"), std::string::npos) << text;
  EXPECT_NE(text.find("MISSION IN FLIGHT\n  no mission is recording\n"), std::string::npos) << text;
  EXPECT_NE(text.find("JOBS\n  none queued or running\n"), std::string::npos) << text;
  EXPECT_TRUE(line_with(text, "rows waiting for storage").ends_with(" 3")) << text;
  EXPECT_TRUE(line_with(text, "live estimates").ends_with(" 2")) << text;
  EXPECT_TRUE(line_with(text, "computations").ends_with(" -")) << "not in the metrics: " << text;
  EXPECT_NE(text.find("4120 accepted, 8 duplicate, 31 rejected"), std::string::npos) << text;
}

TEST(TopScreen, SaysWhatToDoWhenThereAreNoDevices) {
  EXPECT_NE(
      screen(empty_server())
          .find("DEVICES\n  no device is set up: run anchord devices discover, then anchord devices add\n"),
      std::string::npos);
}

TEST(TopScreen, ShowsADeviceWithStateRateAgeAndRejectedUnderTitlesWithUnits) {
  auto documents = empty_server();
  auto lost = device("tag");
  lost["state"] = "lost";
  lost["last_seen_us"] = nullptr;
  lost["reason"] = "no such port";
  const Json radio{{"network_id", "0x6a21"}, {"kind", "anchor"}, {"last_seen_us", k_now_us - 400'000}};
  documents.devices.body = list({device("rover"), lost, radio});
  const auto text = screen(documents);
  EXPECT_NE(text.find("DEVICES (2)\n"), std::string::npos) << text;
  for (const char* title : {"RATE, rows/s", "LAST FRAME, s ago", "REJECTED, count"})
    EXPECT_NE(text.find(title), std::string::npos) << title;
  const auto row = line_with(text, "rover");
  for (const char* cell : {"gnss", "TALKING", " 5.0", " 2.3", " 12"})
    EXPECT_NE(row.find(cell), std::string::npos) << row;
  EXPECT_NE(line_with(text, "LOST").find("no such port"), std::string::npos) << text;
  EXPECT_NE(text.find("Radios seen in the measurements: 1, last seen 0.4 s ago\n"), std::string::npos)
      << text;
}

TEST(TopScreen, ShowsTheMissionThatRecordsWithItsAircraftAndLeavesFinishedOnesOut) {
  auto documents = empty_server();
  const auto mission = [](const char* name, const char* state) {
    return Json{{"name", name},
                {"state", state},
                {"created_at", "2026-05-04T10:09:12.000000Z"},
                {"n_ranges", 4120},
                {"n_fixes", 1200},
                {"devices", {{"recording", false}, {"held_by", {{"mission", "x"}, {"name", "Earlier"}}}}}};
  };
  documents.missions.body = list({mission("North side", "recording"), mission("Done", "finished")});
  auto system = Json::parse(documents.system.body);
  system["drone"] = {{"connected", true}, {"mode", "GUIDED"}, {"armed", true},
                     {"in_air", true},    {"battery", 0.75},  {"above_home_m", 12.34}};
  documents.system.body = system.dump();
  const auto text = screen(documents);
  const auto row = line_with(text, "North side");
  for (const char* cell : {" 120", " 4120", " 1200", "held by Earlier"})
    EXPECT_NE(row.find(cell), std::string::npos) << row;
  EXPECT_EQ(text.find("Done"), std::string::npos);
  EXPECT_NE(text.find("Aircraft: GUIDED, ARMED, IN AIR, battery 75 %, 12.3 m above home\n"),
            std::string::npos)
      << text;
}

TEST(TopScreen, TellsAnAircraftThatWasNeverHeardFromOneThatFellSilent) {
  auto documents = empty_server();
  auto system = Json::parse(documents.system.body);
  system["drone"] = {{"connected", false}, {"silent_s", nullptr}};
  documents.system.body = system.dump();
  EXPECT_NE(screen(documents).find("Aircraft: NOT CONNECTED, nothing received\n"), std::string::npos);
  system["drone"]["silent_s"] = 12.4;
  documents.system.body = system.dump();
  EXPECT_NE(screen(documents).find("Aircraft: NOT CONNECTED, silent for 12 s\n"), std::string::npos);
}

TEST(TopScreen, ShowsJobsThatRunAndThoseThatFailedWithinTheHour) {
  auto documents = empty_server();
  const auto failed = [](const char* at, const char* why) {
    return Json{
        {"kind", "training"}, {"state", "failed"}, {"finished_at", at}, {"problem", {{"detail", why}}}};
  };
  documents.jobs.body = list({Json{{"kind", "calibration"},
                                   {"state", "running"},
                                   {"progress", {{"fraction", 0.42}, {"eta_s", 17.0}, {"stage", "solve"}}}},
                              failed("2026-05-04T10:10:12.000000Z", "too few rows"),
                              failed("2026-05-04T08:00:00.000000Z", "long ago")});
  const auto text = screen(documents);
  const auto row = line_with(text, "RUNNING");
  for (const char* cell : {"calibration", " 42", " 17", "solve"})
    EXPECT_NE(row.find(cell), std::string::npos) << row;
  EXPECT_NE(line_with(text, "FAILED").find("60 s ago: too few rows"), std::string::npos) << text;
  EXPECT_EQ(text.find("long ago"), std::string::npos);
}

TEST(TopScreen, NamesTheCheckThatFailsWhenTheServerIsNotReady) {
  auto documents = empty_server();
  documents.ready.body = R"({"status":"degraded","checks":{"db":"disk is full","migrations":"ok"}})";
  EXPECT_NE(screen(documents).find("Health: DEGRADED; db: disk is full\n"), std::string::npos);
}

TEST(TopScreen, LetsNoHostileNameMoveTheTerminalOrBeginALine) {
  auto documents = empty_server();
  const std::string evil =
      "a\x1b[2J\x1b]0;owned\x07\nALARMS\r\t\x7f\xc2\x9b"
      "31m\xe2\x80\xae"
      "txt";
  documents.devices.body = list({device(evil)});
  documents.alarms.body = list({alarm(evil)});
  documents.version.body = Json{{"version", evil}, {"git", evil}}.dump();
  documents.jobs = {{}, "403 " + evil};
  auto hostile = reading();
  hostile.url = evil;
  hostile.away = cli::TopAway{k_now, evil};
  for (const std::size_t columns : {0U, 20U, 80U}) {
    const auto lines = top_lines(documents, hostile, {columns, 0});
    for (const auto& line : lines) {
      EXPECT_TRUE(std::ranges::none_of(line, [](char c) {
        return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
      })) << line;
      EXPECT_EQ(line.find("\xc2\x9b"), std::string::npos) << "a C1 control: " << line;
      EXPECT_EQ(line.find("\xe2\x80\xae"), std::string::npos) << "right-to-left override: " << line;
    }
    EXPECT_EQ(std::ranges::count_if(lines, [](const auto& line) { return line.starts_with("ALARMS"); }), 1);
  }
}

TEST(TopScreen, KeepsEveryLineWithinANarrowTerminal) {
  auto documents = empty_server();
  documents.devices.body = list({device("rover on the roof of the northern hall"), device("塔の上の受信機")});
  documents.alarms.body = list({alarm(std::string(300, 'x'))});
  for (std::size_t columns = 1; columns <= 120; ++columns)
    for (const auto& line : top_lines(documents, reading(), {columns, 0})) {
      ASSERT_LE(columns_of(line), columns) << line;
      ASSERT_TRUE(is_utf8(line)) << line;
    }
  // At 90 the names give way, not the numbers.
  EXPECT_NE(line_with(screen(documents, {90, 0}), "TALKING").find(" 12"), std::string::npos);
}

TEST(TopScreen, KeepsWithinALowTerminalAndSaysHowMuchIsLeftOut) {
  auto documents = empty_server();
  std::vector<Json> many;
  for (int i = 0; i < 50; ++i) many.push_back(device("rover " + std::to_string(i)));
  documents.devices.body = list(many);
  for (std::size_t rows = 1; rows <= 90; ++rows)
    ASSERT_LE(top_lines(documents, reading(), {80, rows}).size(), rows);
  const auto text = screen(documents, {80, 40});
  EXPECT_NE(text.find("DEVICES (50)"), std::string::npos) << text;
  EXPECT_NE(text.find("more lines\n"), std::string::npos) << text;
  EXPECT_NE(text.find("JOBS\n"), std::string::npos) << "a long section leaves the others room: " << text;
}

TEST(TopScreen, MarksOldDataAndShowsSinceWhenTheServerIsAway) {
  auto away = reading();
  away.now = UtcTime::from_us(k_now_us + 34'000'000);
  away.away = cli::TopAway{UtcTime::from_us(k_now_us + 1'000'000), "connection refused"};
  const auto text = joined(top_lines(empty_server(), away, {}));
  EXPECT_NE(text.find("SERVER NOT REACHABLE since 2026-05-04 10:11:13 UTC: connection refused\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("OLD data of 2026-05-04 10:11:12 UTC, 34 s ago"), std::string::npos) << text;
  for (const char* title : {"ALARMS - OLD\n", "DEVICES - OLD\n", "QUEUES - OLD\n", "JOBS - OLD\n"})
    EXPECT_NE(text.find(title), std::string::npos) << title;
  EXPECT_EQ(screen(empty_server()).find("OLD"), std::string::npos);
}

TEST(TopScreen, ShowsWhyASectionIsMissingAndTheOthersAllTheSame) {
  auto documents = empty_server();
  documents.devices = {{}, "403 the role gateway may not read devices"};
  documents.metrics = {{}, "401 a token is needed"};
  const auto text = screen(documents);
  EXPECT_NE(text.find("DEVICES\n  not shown: 403 the role gateway may not read devices\n"),
            std::string::npos);
  EXPECT_NE(text.find("metrics not shown: 401 a token is needed\n"), std::string::npos) << text;
  EXPECT_NE(text.find("ALARMS\n  none\n"), std::string::npos);
}

TEST(TopScreen, BearsDocumentsThatAreNotWhatTheContractPromises) {
  for (const char* body :
       {"", "null", "[]", "7", "\"x\"", "{\"items\":7}", "{\"items\":[7,null,[],{}]}", "{\"t_us\":1e999}",
        R"({"items":[{"address":7,"name":[],"state":"recording","dropped":{"a":"b"},"rate_hz":"x"}]})",
        R"({"t_us":1e308,"queue_depth":-1e308,"drone":[],"checks":7,"status":7})"}) {
    cli::TopDocuments documents;
    for (auto* document : {&documents.version, &documents.ready, &documents.system, &documents.alarms,
                           &documents.devices, &documents.missions, &documents.jobs, &documents.metrics})
      document->body = body;
    EXPECT_GT(top_lines(documents, reading(), {80, 24}).size(), 5u) << body;
  }
}

TEST(TextTable, ShowsJsonThatMovesNoTerminalAndIsStillTheSameJson) {
  const Json names = {
      "a\xc2\x9b"
      "31m",
      "gnp\xe2\x80\xae.exe", "caf\xc3\xa9 \xf0\x9f\x9b\xb0\n", "a\"b\\c"};
  const auto shown = cli::printable_json(names.dump(1));
  EXPECT_EQ(Json::parse(shown), names);
  EXPECT_EQ(shown.find("\xc2\x9b"), std::string::npos) << shown;
  EXPECT_EQ(shown.find("\xe2\x80\xae"), std::string::npos) << shown;
  EXPECT_NE(shown.find("caf\xc3\xa9 \xf0\x9f\x9b\xb0"), std::string::npos) << shown;
}

TEST(TextTable, CountsWideAndCombiningCharactersAsATerminalDoes) {
  // Unicode's EastAsianWidth.txt: hiragana and hangul are W, a combining acute takes no column.
  EXPECT_EQ(columns_of("abc"), 3u);
  EXPECT_EQ(columns_of("あ한"), 4u);
  EXPECT_EQ(columns_of("e\xcc\x81"), 1u);
  EXPECT_EQ(columns_of(""), 0u);
}

TEST(TextTable, CutsBetweenCharacters) {
  EXPECT_EQ(cut_to("abcdef", 6), "abcdef");
  EXPECT_EQ(cut_to("abcdefg", 6), "abc...");
  EXPECT_EQ(cut_to("abcd", 2), "ab");
  EXPECT_EQ(cut_to("ああああ", 6), "あ...");  // 8 columns; two of them would need 7
  EXPECT_EQ(cut_to("abc", 0), "");
}

TEST(TextTable, AlignsNumbersToTheRightAndKeepsARowThatEndsEarly) {
  EXPECT_EQ(table_lines({{"NAME", false, true}, {"RATE, Hz", true, false}}, {{"a", "5.0"}, {"b"}}, 0),
            (std::vector<std::string>{"NAME  RATE, Hz", "a          5.0", "b"}));
}

TEST(TextTable, MakesOneLineOfTextWithBreaks) { EXPECT_EQ(one_line("a\nb\tc\rd"), "a b c\\x0dd"); }

}  // namespace
}  // namespace anchord::test::top_screen_test
