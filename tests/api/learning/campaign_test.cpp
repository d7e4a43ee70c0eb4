#include "api/formats/campaign.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace anchord::api::campaign_test {

TEST(Campaign, ReadsPlainTextOfOneMeasurementALine) {
  const auto read = import_campaign(
      "# true_distance_m = 4.5\n# los = 1\n# environment: hall A\n"
      "1526300000123 4512 -79.25\n"
      "timestamp: 1526300000223 ms, distance: 4498 mm, RSS: -80 dBm\n"
      "1526300000323,0,-95\n");
  ASSERT_TRUE(read) << read.error().message;
  const auto& c = read.value().campaign;
  ASSERT_EQ(c.measurements.size(), 2U);
  EXPECT_NEAR(c.measurements[0].range_m, 4.512, 1e-12);
  EXPECT_NEAR(*c.measurements[1].rx_dbm, -80, 1e-12);
  EXPECT_NEAR(*c.measurements[0].t_s, 1526300000.123, 1e-6);
  ASSERT_EQ(c.sites.size(), 1U);
  EXPECT_EQ(c.sites[0].environment, "hall A");
  EXPECT_NEAR(*c.sites[0].distance_m, 4.5, 1e-12);
  EXPECT_EQ(c.sites[0].los, true);
  EXPECT_EQ(read.value().report.dropped.at("zero range").count, 1U);
}

TEST(Campaign, ReadsDecimalCommasOrSaysWhatToDo) {
  const auto text = import_campaign(
      "# distance_m = 4,5\n1000 4512,5 -79,25\n1100;4498;-80,5\n1200,4510,-81.5\n1300,0,4511,0,-82,5\n");
  ASSERT_TRUE(text) << text.error().message;
  const auto& m = text.value().campaign.measurements;
  ASSERT_EQ(m.size(), 3U);
  EXPECT_NEAR(m[0].range_m, 4.5125, 1e-12);
  EXPECT_EQ(m[0].rx_dbm, -79.25);
  EXPECT_EQ(m[1].rx_dbm, -80.5);
  EXPECT_EQ(m[2].rx_dbm, -81.5);
  EXPECT_EQ(text.value().campaign.sites[0].distance_m, 4.5);
  ASSERT_EQ(text.value().report.errors.size(), 1U);
  EXPECT_EQ(text.value().report.errors[0].line, 5U);
  EXPECT_NE(text.value().report.errors[0].detail.find("decimal commas"), std::string::npos);
  const auto csv = import_campaign("site;range_m;true_range_m;los\na;4,52;4,5;1\na;4,48;4,5;1\n");
  ASSERT_TRUE(csv) << csv.error().message;
  ASSERT_EQ(csv.value().campaign.measurements.size(), 2U);
  EXPECT_EQ(csv.value().campaign.measurements[0].range_m, 4.52);
  EXPECT_EQ(csv.value().campaign.sites[0].distance_m, 4.5);
  const auto torn = import_campaign("site,range_m,true_range_m,los\na,4,52,4,5,1\n");
  ASSERT_TRUE(torn);
  EXPECT_NE(torn.value().report.errors[0].detail.find("semicolons"), std::string::npos);
  const auto truth = import_campaign("# distance_m = long\n1000 4512 -79\n");
  EXPECT_EQ(truth.value().report.errors[0].line, 1U);
}

TEST(Campaign, ReadsTheSeparatorLineOfExcelAndUtf16WithItsMark) {
  const std::string table = "site;range_m;true_range_m;los\r\na;4,52;4,5;1\r\n";
  const auto plain = import_campaign("sep=;\r\n" + table);
  ASSERT_TRUE(plain) << plain.error().message;
  ASSERT_EQ(plain.value().campaign.measurements.size(), 1U);
  EXPECT_EQ(plain.value().campaign.measurements[0].range_m, 4.52);
  EXPECT_EQ(plain.value().campaign.measurements[0].line, 3U);
  for (const bool little : {true, false}) {
    std::string wide = little ? "\xFF\xFE" : "\xFE\xFF";
    for (const char c : table) wide += little ? std::string{c, '\0'} : std::string{'\0', c};
    const auto read = import_campaign(wide);
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read.value().campaign.measurements.size(), 1U);
    EXPECT_EQ(read.value().campaign.measurements[0].range_m, 4.52);
    EXPECT_FALSE(import_campaign(wide.substr(2))) << "without its mark nobody knows";
  }
  const auto tabs = import_campaign("range_m\ttrue_range_m\trx_dbm\n4.5\t4.4\t\n");
  ASSERT_TRUE(tabs) << tabs.error().message;
  EXPECT_EQ(tabs.value().report.kept, 1U) << "an empty cell at the end of a line";
}

// Each of them became measurements of millimetres, or of numbers that are something else.
TEST(Campaign, RefusesWhatItDoesNotUnderstandWithLineReasonAndWhatToDo) {
  const auto refused = [](const std::string& text) {
    const auto read = import_campaign(text);
    if (!read) return read.error().message;
    EXPECT_EQ(read.value().report.kept, 0U) << text;
    if (read.value().report.errors.empty()) return std::string();
    const auto& first = read.value().report.errors[0];
    return "line " + std::to_string(first.line) + ": " + first.detail;
  };
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  EXPECT_THAT(refused("id;dist;level\n1;4.51;-79\n"),
              AllOf(HasSubstr("line 1: no column of measured ranges"), HasSubstr("\"id\", \"dist\"")));
  EXPECT_THAT(refused("1|4.51|-79\n"), HasSubstr("line 1: not a number"));
  EXPECT_THAT(refused("1 4.51 -79\n"), AllOf(HasSubstr("line 1: range impossible: 0.005 m"),
                                             HasSubstr("shorter than any radio measures")));
  EXPECT_THAT(import_campaign("1000 4510 -79\n1000 4.51 m -79\n").value().report.errors.at(0).detail,
              AllOf(HasSubstr("\"m\" is not understood"), HasSubstr("give anything else as CSV")));
  EXPECT_THAT(import_campaign("1000 4510 mm\n4510 mm 1000 ms\n").value().report.errors.at(0).detail,
              HasSubstr("is not the unit of the number before it"));
  EXPECT_THAT(import_campaign("1000 4510 -79\nrange 4510 time 1000\n").value().report.errors.at(0).detail,
              HasSubstr("announces is not the first"));
  EXPECT_THAT(refused("1000 4510 -79 12\n"), HasSubstr("line 1: more than three numbers"));
  EXPECT_THAT(refused("1000 4510 -999\n"), HasSubstr("no level"));
  EXPECT_THAT(refused("range,true_range_m\n4510,4.5\n"), HasSubstr("impossible")) << "no unit: metres";
  EXPECT_THAT(refused("range_m,true_range_m\n\"4,51\",4.5\n"), HasSubstr("semicolons"));
  EXPECT_THAT(refused("range_m,range_m,true_range_m\n4.5,4.6,4.4\n"), HasSubstr("two columns are named"));
}

TEST(Campaign, WarnsOfPlacesThatDifferInCapitalsAlone) {
  const auto read =
      import_campaign("environment,range_m,true_range_m\nHall A,4.5,4.4\nhall a,4.5,4.4\nhall b,4.5,4.4\n");
  ASSERT_TRUE(read);
  ASSERT_EQ(read.value().report.warnings.size(), 1U);
  EXPECT_THAT(read.value().report.warnings[0], ::testing::HasSubstr(R"("Hall A", "hall a")"));
}

TEST(Campaign, TakesAnImpulseResponseOfAnNdjsonLine) {
  const auto read = import_campaign(
      R"({"range_m":5,"true_range_m":4.9,"cir":{"n":2,"dt_ps":1001.6,"first_path_idx":1,"b64":"AQACAP//BAA="}})"
      "\n"
      R"({"range_m":5,"true_range_m":4.9,"cir":{"n":3,"b64":"AQACAP//BAA="}})"
      "\n");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read.value().campaign.measurements.size(), 1U);
  EXPECT_EQ(read.value().campaign.measurements[0].cir->re_im, (std::vector<std::int16_t>{1, 2, -1, 4}));
  EXPECT_NE(read.value().report.errors[0].detail.find("/cir/b64"), std::string::npos);
}

TEST(Campaign, ReadsCsvAndNdjsonToTheSameCampaign) {
  const auto csv = import_campaign(
      "site,environment,material,distance_m,heading_deg,height_m,thickness_m,los,range_m,rx_dbm\n"
      "s1,lab,,3,22.5,0.5,,1,3.05,-79\n"
      "s2,lab,brick,3,0,0,0.12,0,3.61,-86\n");
  const auto ndjson = import_campaign(
      R"({"site":"s1","environment":"lab","distance_m":3,"heading_deg":22.5,"height_m":0.5,"los":true,"range_m":3.05,"rx_dbm":-79})"
      "\n"
      R"({"site":"s2","environment":"lab","material":"brick","distance_m":3,"heading_deg":0,"height_m":0,"thickness_m":0.12,"los":"NLOS","range_m":3.61,"rx_dbm":-86})"
      "\n");
  ASSERT_TRUE(csv) << csv.error().message;
  ASSERT_TRUE(ndjson) << ndjson.error().message;
  EXPECT_EQ(csv.value().report.format, CampaignFormat::csv);
  EXPECT_EQ(ndjson.value().report.format, CampaignFormat::ndjson);
  EXPECT_EQ(csv.value().campaign.sites, ndjson.value().campaign.sites);
  EXPECT_EQ(campaign_csv(csv.value().campaign), campaign_csv(ndjson.value().campaign));
  EXPECT_EQ(csv.value().campaign.sites[1].los, false);
}

TEST(Campaign, BadLinesNeverSinkGoodOnesAndAreNamed) {
  const auto read =
      import_campaign("range_m,true_range_m,los\n2.0,1.9,1\nabc,1.9,1\n2.0,1.9\n2.1,1.9,maybe\n2.2,1.9,1\n");
  ASSERT_TRUE(read);
  const auto& r = read.value().report;
  EXPECT_EQ(r.lines, 5U);
  EXPECT_EQ(r.kept, 2U);
  EXPECT_EQ(r.dropped.at("unreadable line").count, 1U);
  EXPECT_EQ(r.dropped.at("impossible value").count, 2U);
  ASSERT_EQ(r.errors.size(), 3U);
  EXPECT_EQ(r.errors[0].line, 3U);
  EXPECT_EQ(r.errors[1].line, 4U);
  EXPECT_EQ(r.errors[2].line, 5U);
}

TEST(Campaign, NamesLineColumnAndReasonOfMissingAndImpossibleValues) {
  std::string text =
      "site,range_m,true_range_m,los,rx_dbm,std_noise\n"
      "a,2.0,1.9,1,-80,40\n"   // line 2, good
      "a,,1.9,1,-80,40\n"      // 3: no range
      "a,2.0,1.9,1,-800,40\n"  // 4: no such level
      "a,2.0,-3,1,-80,40\n"    // 5: no such truth
      "a,2.0,1.9,1,-80,-1\n"   // 6: no such noise
      "a,0,1.9,1,-80,40\n"     // 7: no answer
      "a,2.0,1.9,1,n/a,\n"     // 8, good: levels may be missing
      "a,inf,1.9,1,-80,40\n";  // 9
  for (int i = 0; i < 30; ++i) text += "a,-2.0,1.9,1,-80,40\n";
  const auto read = import_campaign(text);
  ASSERT_TRUE(read);
  const auto& r = read.value().report;
  EXPECT_EQ(r.kept, 2U);
  const auto& missing = r.dropped.at("missing value");
  EXPECT_EQ(missing.count, 1U);
  EXPECT_EQ(missing.first.at(0).line, 3U);
  const auto& impossible = r.dropped.at("impossible value");
  EXPECT_EQ(impossible.count, 34U);
  ASSERT_EQ(impossible.first.size(), 20U);
  EXPECT_EQ(impossible.first[0].line, 4U);
  EXPECT_EQ(impossible.first[0].column, "rx_dbm");
  EXPECT_NE(impossible.first[0].detail.find("-800"), std::string::npos);
  EXPECT_EQ(impossible.first[1].column, "true_range_m");
  EXPECT_EQ(impossible.first[2].column, "std_noise");
  EXPECT_EQ(impossible.first[3].line, 9U);
  EXPECT_EQ(impossible.first[3].column, "range_m");
  EXPECT_EQ(impossible.first[19].line, 25U);
  EXPECT_EQ(r.dropped.at("zero range").first.at(0).line, 7U);
  EXPECT_EQ(r.dropped.at("zero range").first.at(0).column, "range_m");
  EXPECT_EQ(r.errors.size(), 35U);
}

// Twenty ranges within 2 cm of 5 m, and one of 9 m: the median stays, the outlier goes and is reported.
TEST(Campaign, DropsOutliersOfASiteByItsMedianAndSaysSo) {
  std::string text = "site,range_m,true_range_m,los\n";
  for (int i = 0; i < 20; ++i) text += "a," + std::to_string(5 + 0.001 * i) + ",5,1\n";
  text += "a,9.0,5,1\nb,9.0,9,1\n";
  const auto read = import_campaign(text);
  ASSERT_TRUE(read);
  EXPECT_EQ(read.value().report.kept, 21U);
  EXPECT_EQ(read.value().report.sites[0].outliers, 1U);
  EXPECT_NEAR(read.value().report.sites[0].median_m, 5.0095, 1e-9);
  CampaignOptions keep_all;
  keep_all.filter = false;
  EXPECT_EQ(import_campaign(text, keep_all).value().report.kept, 22U);
}

TEST(Campaign, WrittenAndReadAgainIsTheSameTable) {
  std::string text = "site,environment,range_m,true_range_m,los,rx_dbm,fp_dbm\n";
  for (int i = 0; i < 12; ++i)
    text += "s" + std::to_string(i / 3) + ",room " + std::to_string(i / 6) + "," +
            std::to_string(3 + 0.1 / (i + 1)) + ",3," + std::to_string(i % 2) + ",-80.125,-82.5\n";
  const auto first = import_campaign(text);
  ASSERT_TRUE(first);
  const auto again = import_campaign(campaign_csv(first.value().campaign));
  ASSERT_TRUE(again);
  EXPECT_EQ(campaign_csv(first.value().campaign), campaign_csv(again.value().campaign));
  const auto table = table_of(first.value().campaign);
  EXPECT_EQ(table.rows(), 12U);
  EXPECT_EQ(table.group_names.size(), 2U);
  EXPECT_NEAR(*table.features[0].get(nlos::Feature::rx_minus_fp_db), 2.375, 1e-12);
}

TEST(Campaign, HostileTextEndsInAnErrorNotInACrash) {
  EXPECT_EQ(import_campaign("").error().code, Errc::bad_frame);
  EXPECT_EQ(import_campaign("\n\n# only = comments\n").error().code, Errc::bad_frame);
  for (const char* text : {"range_m\nnan\ninf\n-1\n1e999\n", "{\"range_m\":[[[[1]]]]}\n{\n",
                           "\xff\xfe 1 2 3\n", "# =\n# :\n1"}) {
    const auto read = import_campaign(text);
    EXPECT_TRUE(!read || read.value().report.kept <= 1U);
  }
}

/// 0 was LOS for training and NLOS for campaigns, of the same file.
TEST(Campaign, RefusesNumbersOfAClassUntilSomebodySaysWhichIsLos) {
  using ::testing::HasSubstr;
  for (const std::string name : {"cls", "label", "class"}) {
    const std::string text = name + ",range_m\n1,5\n0,6\n";
    const auto untold = import_campaign(text);
    ASSERT_FALSE(untold) << name;
    EXPECT_THAT(untold.error().message, HasSubstr("los_value"));
    CampaignOptions options;
    options.los_value = "0";
    const auto told = import_campaign(text, options);
    ASSERT_TRUE(told) << told.error().message;
    ASSERT_EQ(told.value().campaign.sites.size(), 2U);
    EXPECT_EQ(told.value().campaign.sites[0].los, false);
    EXPECT_EQ(told.value().campaign.sites[1].los, true);
    EXPECT_EQ(told.value().report.classes, (std::map<std::string, std::string>{{name, "0"}}));
    options.los_value = "2";
    EXPECT_FALSE(import_campaign(text, options));
  }
  const auto pandas = import_campaign("NLOS,range_m\nTrue,5\nFalse,6\n");
  ASSERT_TRUE(pandas) << pandas.error().message;
  EXPECT_EQ(pandas.value().campaign.sites.at(0).los, false);
  EXPECT_EQ(pandas.value().report.classes, (std::map<std::string, std::string>{{"NLOS", "False"}}));
  const auto beside = import_campaign("label,nlos,range_m\nsoft wall,1,5\n2,0,6\n");
  ASSERT_TRUE(beside) << beside.error().message;
  EXPECT_EQ(beside.value().report.kept, 2U);
  EXPECT_EQ(beside.value().campaign.sites.at(0).los, false);
  const auto against = import_campaign("los,nlos,range_m\n1,1,5\n1,0,5\n");
  ASSERT_TRUE(against);
  EXPECT_EQ(against.value().report.kept, 1U);
}

TEST(Campaign, FindsColumnsHoweverTheyAreSpelledAndNamesThoseItDoesNotUse) {
  // The header of eWINE's part1.csv, with an impulse response of five taps.
  const auto read = import_campaign(
      "NLOS,RANGE,FP_IDX,FP_AMP1,FP_AMP2,FP_AMP3,STDEV_NOISE,CIR_PWR,MAX_NOISE,RXPACC,CH,FRAME_LEN,PREAM_LEN,"
      "BITRATE,PRFR,CIR0,CIR1,CIR2,CIR3,CIR4\n"
      "1.0,6.18,749.0,4889.0,13876.0,10464.0,240.0,9048.0,3668.0,1024.0,2,39,1024,110,64,1,2,3,4,5\n");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read.value().campaign.measurements.size(), 1U);
  const auto& m = read.value().campaign.measurements[0];
  EXPECT_EQ(m.range_m, 6.18);
  EXPECT_EQ(m.fp_index, 749);
  EXPECT_EQ(m.std_noise, 240);
  EXPECT_EQ(read.value().campaign.sites[0].los, false);
  EXPECT_EQ(read.value().report.unused, (std::vector<std::string>{"CH", "FRAME_LEN", "PREAM_LEN", "BITRATE",
                                                                  "PRFR", "CIR0 to CIR4 (5 columns)"}));
  const auto spelled =
      import_campaign("Environment,True Distance [cm],LOS,Range (cm),RX_dBm,note\nhall,500,1,510,-80,x\n");
  ASSERT_TRUE(spelled) << spelled.error().message;
  ASSERT_EQ(spelled.value().campaign.measurements.size(), 1U);
  EXPECT_NEAR(spelled.value().campaign.measurements[0].range_m, 5.1, 1e-12);
  EXPECT_EQ(spelled.value().campaign.measurements[0].rx_dbm, -80);
  EXPECT_NEAR(*spelled.value().campaign.sites[0].distance_m, 5.0, 1e-12);
  EXPECT_EQ(spelled.value().campaign.sites[0].environment, "hall");
  EXPECT_EQ(spelled.value().report.unused, std::vector<std::string>{"note"});
  const auto json = import_campaign("{\"Range_mm\":5100,\"true_distance_mm\":5000,\"note\":1}\n");
  ASSERT_TRUE(json) << json.error().message;
  EXPECT_NEAR(*json.value().campaign.sites[0].distance_m, 5.0, 1e-12);
  EXPECT_EQ(json.value().report.unused, std::vector<std::string>{"note"});
}

TEST(Campaign, RefusesRangesAndTruthOfTwoUnits) {
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  const auto why = [](const std::string& text) {
    const auto read = import_campaign(text);
    return read ? std::string() : read.error().message;
  };
  EXPECT_THAT(why("range_m,true_distance_m\n5100,5\n6200,6\n"),
              AllOf(HasSubstr("\"range_m\""), HasSubstr("rename it to range_mm")));
  EXPECT_THAT(why("range,true_distance_m\n510,5\n620,6\n"), HasSubstr("rename it to range_cm"));
  EXPECT_THAT(why("range_m,true_distance_m\n5.1,5000\n6.2,6000\n"), HasSubstr("true_distance_mm"));
  EXPECT_EQ(why("range_m,true_distance_m\n7.1,5\n6.2,6\n"), "");
}

TEST(Campaign, RefusesWhatIsNoTextWithWhatItIs) {
  using ::testing::HasSubstr;
  const auto why = [](const std::string& text) {
    const auto read = import_campaign(text);
    return read ? std::string() : read.error().message;
  };
  EXPECT_THAT(why(std::string("PK\x03\x04 1 2 3\n1000 4510 -79\n")), HasSubstr("zip"));
  EXPECT_THAT(why("MATLAB 5.0 MAT-file, 1 2\n1000 4510 -79\n"), HasSubstr("writetable"));
  EXPECT_THAT(why("#ROSBAG V2.0\n1000 4510 -79\n"), HasSubstr("rostopic echo"));
  EXPECT_THAT(why("\x1F\x8B\b1000 4510 -79\n"), HasSubstr("gzip"));
  EXPECT_THAT(why("\x01\x02\x03\x04 1000 4510\n"), HasSubstr("binary"));
}

}  // namespace anchord::api::campaign_test
