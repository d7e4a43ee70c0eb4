#include "api/formats/labelled_table.hpp"
#include "api/learning/labelled_dataset.hpp"

#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <cmath>
#include <fstream>

#include "api/formats/gzip_lines.hpp"
#include "api/learning/dataset_table.hpp"

namespace anchord::api::labelled_table_test {
namespace {

class LabelledTableTest : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = std::filesystem::temp_directory_path() /
           ("anchord_table_" + std::to_string(getpid()) + "_" +
            ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(dir_);
  }
  void TearDown() override { std::filesystem::remove_all(dir_); }

  std::filesystem::path plain(const std::string& name, const std::string& text) {
    std::ofstream{dir_ / name, std::ios::binary} << text;
    return dir_ / name;
  }
  std::filesystem::path gzip(const std::string& name, const std::string& text) {
    const gzFile f = gzopen((dir_ / name).c_str(), "wb");
    gzwrite(f, text.data(), static_cast<unsigned>(text.size()));
    gzclose(f);
    return dir_ / name;
  }
  static Result<LabelledTable> read(std::vector<std::filesystem::path> paths, TableOptions options = {}) {
    return read_labelled_tables(paths, options);
  }

  std::filesystem::path dir_;
};

const std::string k_rooms =
    "env,nlos,setup_id,range_m,true_range_m,rx_dbm,fp_dbm\n"
    "hw,0,a,5.1,5.0,-80,-82\n"
    "hw,1,b,6.9,6.0,-85,-95\n"
    "til,0,c,3.0,3.0,-75,-77\n";

}  // namespace

TEST_F(LabelledTableTest, ReadsGzipAndPlainAlikeAndMapsColumnsByName) {
  const auto a = read({gzip("r.csv.gz", k_rooms)}), b = read({plain("r.csv", k_rooms)});
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a.value().range_m, b.value().range_m);
  EXPECT_EQ(a.value().group, b.value().group);
  const auto& t = a.value();
  EXPECT_EQ(t.rows(), 3U);
  EXPECT_EQ(t.los[0], true);
  EXPECT_EQ(t.los[1], false);
  EXPECT_EQ(t.truth_column, "true_range_m");
  EXPECT_EQ(t.group_by, "env");
  EXPECT_EQ(t.group, (std::vector<std::uint32_t>{0, 0, 1}));
  EXPECT_NEAR(*t.features[1].get(nlos::Feature::rx_minus_fp_db), 10, 1e-12);
}

TEST_F(LabelledTableTest, ReadsWhatASpreadsheetMakesOfIt) {
  // Byte-order mark, semicolons, CRLF, names with capitals and units, millimetres.
  const auto t = read({plain("r.csv",
                             "\xEF\xBB\xBF"
                             "Room;NLOS;Range_mm;Ground Truth;RX dBm\r\n"
                             "hall;0;5100;5.0;-80\r\noffice;1;6900;6.0;-85\r\n")});
  ASSERT_TRUE(t) << t.error().message;
  EXPECT_NEAR(t.value().range_m.at(0), 5.1, 1e-12);
  EXPECT_NEAR(t.value().range_m.at(1), 6.9, 1e-12);
  EXPECT_EQ(t.value().true_range_m[1], 6.0);
  EXPECT_EQ(t.value().group_by, "Room");
  EXPECT_EQ(t.value().los[0], true);
  EXPECT_EQ(t.value().features[0].get(nlos::Feature::rx_dbm), -80);
}

TEST_F(LabelledTableTest, NeverTakesAnUnknownWordForNlos) {
  const auto t = read({plain("r.csv", "nlos,range_m\n0,5\n1,6\nmaybe,7\nLOS,8\n")});
  ASSERT_TRUE(t) << t.error().message;
  EXPECT_EQ(t.value().rows(), 3U);
  EXPECT_EQ(t.value().los[2], true);
  EXPECT_NE(t.value().dropped.at("nlos is neither 0 nor 1, LOS nor NLOS").second.find("r.csv:4"),
            std::string::npos);
}

TEST_F(LabelledTableTest, LeavesOutRowsWhoseColumnsOfTheClassContradictEachOther) {
  const auto path = plain("r.csv", "los,nlos,range_m\n1,0,5\n0,1,6\n1,1,7\n0,0,8\n,1,9\n");
  const auto t = read({path});
  ASSERT_TRUE(t) << t.error().message;
  EXPECT_EQ(t.value().los, (std::vector<std::optional<bool>>{true, false, false}));
  const auto& [n, where] = t.value().dropped.at("los contradicts nlos");
  EXPECT_EQ(n, 2U);
  EXPECT_NE(where.find("r.csv:4"), std::string::npos) << where;
  TableOptions options;
  options.label = "los";
  EXPECT_EQ(read({path}, options).value().rows(), 4U) << "the column that was chosen counts alone";
}

TEST_F(LabelledTableTest, NamesTheColumnsOfAFileWithoutRangesAndTakesOneByName) {
  const auto path = plain("r.csv", "env,dist_to_anchor,nlos\na,5,0\n");
  const auto none = read({path});
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("env, dist_to_anchor, nlos"), std::string::npos);
  TableOptions options;
  options.range = "dist_to_anchor";
  EXPECT_TRUE(read({path}, options));
}

TEST_F(LabelledTableTest, DropsMissingAndImpossibleValuesAndSaysWhere) {
  const auto t = read({plain("r.csv",
                             "nlos,range_m,rx_dbm,fp_dbm\n0,0,-80,-82\n0,,-80,-82\n1,5,-inf,-82\n,4,-80,-"
                             "81\n0,nan,-80,-81\n1,7,-80,-82\n")});
  ASSERT_TRUE(t);
  EXPECT_EQ(t.value().rows(), 2U);
  EXPECT_EQ(t.value().dropped.at("range_m not above zero").first, 1U);
  EXPECT_EQ(t.value().dropped.at("range_m missing").first, 2U);
  EXPECT_NE(t.value().dropped.at("nlos missing").second.find("r.csv:5"), std::string::npos);
  std::vector<std::size_t> rows;
  Dropped dropped;
  const auto d = dataset_from(t.value(), {{"range_m", "rx_dbm"}, true, false}, rows, dropped);
  ASSERT_TRUE(d);
  EXPECT_EQ(rows, std::vector<std::size_t>{1});
  EXPECT_EQ(dropped.at("no rx_dbm").first, 1U);
  EXPECT_NE(dropped.at("no rx_dbm").second.find("r.csv:4"), std::string::npos);
  // A feature no row has: the error names it, with the first line.
  const auto none = dataset_from(t.value(), {{"range_m", "kurtosis"}, true, false}, rows, dropped);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("no kurtosis in 2 (first"), std::string::npos) << none.error().message;
}

TEST_F(LabelledTableTest, KeepsRowsWithoutATrueRangeForTheirClass) {
  const auto t = read({plain("r.csv",
                             "room,nlos,range_m,true_range_m\na,0,5.1,5\na,0,6.1,\na,0,6.3,NaN\na,1,7.9,7\n"
                             "a,1,7.9,-3\na,1,7.9,long\n")});
  ASSERT_TRUE(t) << t.error().message;
  EXPECT_EQ(t.value().rows(), 4U);
  EXPECT_EQ(t.value().dropped.at("true_range_m impossible").first, 1U);
  EXPECT_NE(t.value().dropped.at("true_range_m is no number").second.find("r.csv:7"), std::string::npos);
  // Nothing says that the two stand at one placement.
  EXPECT_NE(t.value().placement[1], t.value().placement[2]);
  std::vector<std::size_t> rows;
  Dropped dropped;
  const auto classes = dataset_from(t.value(), {{"range_m"}, true, false}, rows, dropped);
  ASSERT_TRUE(classes);
  EXPECT_EQ(classes.value().rows(), 4U);
  EXPECT_FALSE(classes.value().has_truth());
  EXPECT_TRUE(dropped.empty());
  const auto bias = dataset_from(t.value(), {{"range_m"}, true, true}, rows, dropped);
  ASSERT_TRUE(bias);
  EXPECT_EQ(rows, (std::vector<std::size_t>{0, 3}));
  EXPECT_NE(dropped.at("no true_range_m").second.find("r.csv:3"), std::string::npos);
}

TEST_F(LabelledTableTest, ReadsDecimalCommasBetweenSemicolonsAndRefusesThemBetweenCommas) {
  const auto t = read({plain("r.csv",
                             "env;nlos;range_m;true_range_m;rx_dbm\nhall;0;5,25;5,0;-80,5\n"
                             "hall;1;1.234,5;5;-80\n")});
  ASSERT_TRUE(t) << t.error().message;
  ASSERT_EQ(t.value().rows(), 1U);
  EXPECT_EQ(t.value().range_m[0], 5.25);
  EXPECT_EQ(t.value().true_range_m[0], 5.0);
  EXPECT_EQ(t.value().features[0].get(nlos::Feature::rx_dbm), -80.5);
  EXPECT_NE(t.value().dropped.at("range_m is no number").second.find("r.csv:3"), std::string::npos);
  const auto torn = read({plain("c.csv", "nlos,range_m\n0,5,25\n")});
  ASSERT_FALSE(torn);
  EXPECT_NE(torn.error().message.find("c.csv:2"), std::string::npos);
  EXPECT_NE(torn.error().message.find("with decimal commas, separate the cells by semicolons"),
            std::string::npos);
}

// The path to a file is none of the data's business: the same file elsewhere is the same data set.
TEST_F(LabelledTableTest, RowsOfADataSetNameTheirFileAsCampaignAndTheirPlacementAsSetting) {
  const auto t =
      read({plain("may 5.csv", "env,nlos,range_m,true_range_m,fp_amp1\nhw,0,5.1,5,900\nhw,1,6.9,6,\n")});
  ASSERT_TRUE(t);
  const auto rows = dataset_rows(t.value());
  ASSERT_EQ(rows.rows.size(), 2U);
  EXPECT_EQ(rows.rows[0].campaign, "may 5");
  EXPECT_EQ(rows.rows[0].environment, "hw");
  EXPECT_EQ(rows.rows[0].setting, "hw/5/0");
  EXPECT_EQ(rows.rows[1].los, false);
  EXPECT_EQ(rows.registers, std::vector<std::string>{"fp_amp1"});
  EXPECT_EQ(rows.rows[0].registers[0], 900);
  EXPECT_TRUE(std::isnan(rows.rows[1].registers[0]));
}

TEST_F(LabelledTableTest, NamesTheLineOfABrokenRowAndTheColumnThatLacks) {
  const auto torn = read({plain("r.csv", "nlos,range_m\n0,1\n0,1,2\n")});
  ASSERT_FALSE(torn);
  EXPECT_NE(torn.error().message.find("r.csv:3"), std::string::npos);
  TableOptions options;
  options.label = "wall";
  const auto lacking = read({plain("r.csv", k_rooms)}, options);
  ASSERT_FALSE(lacking);
  EXPECT_NE(lacking.error().message.find("no column wall"), std::string::npos);
  EXPECT_NE(lacking.error().message.find("setup_id"), std::string::npos);
  EXPECT_FALSE(read({plain("e.csv", "")}));
  EXPECT_FALSE(read({plain("h.csv", "nlos,range_m\n")}));
  EXPECT_FALSE(read({plain("n.csv", "a,b\n1,2\n")}));
  EXPECT_FALSE(read({dir_ / "absent.csv"}));
  EXPECT_FALSE(read({dir_}));
}

TEST_F(LabelledTableTest, RefusesATruncatedGzipInsteadOfTrainingOnHalfOfIt) {
  std::string text = "nlos,range_m\n";
  for (int i = 0; i < 5000; ++i)
    text += std::to_string(i % 2) + "," + std::to_string(1 + (i * 7919) % 1000) + "\n";
  const auto whole = gzip("r.csv.gz", text);
  std::filesystem::resize_file(whole, std::filesystem::file_size(whole) / 2);
  EXPECT_FALSE(read({whole}));
}

TEST_F(LabelledTableTest, RefusesNumbersOfAClassUntilSomebodySaysWhichIsLos) {
  for (const std::string name : {"cls", "label", "class"}) {
    const auto path = plain("r.csv", name + ",range_m\n2,1\n1,1\n3,1\n");
    const auto untold = read({path});
    ASSERT_FALSE(untold) << name;
    EXPECT_NE(untold.error().message.find("--los-value"), std::string::npos) << untold.error().message;
    TableOptions options;
    options.los_value = "3";
    const auto told = read({path}, options);
    ASSERT_TRUE(told) << told.error().message;
    EXPECT_EQ(told.value().los, (std::vector<std::optional<bool>>{false, false, true}));
    EXPECT_EQ(told.value().los_value, "3");
    options.los_value = "7";
    EXPECT_FALSE(read({path}, options));
  }
  const auto words = read({plain("w.csv", "class,range_m\nLOS,5\nNDP NLOS,5\nnlos,5\n")});
  ASSERT_TRUE(words) << words.error().message;
  EXPECT_EQ(words.value().los, (std::vector<std::optional<bool>>{true, false, false}));
  const auto pandas = read({plain("p.csv", "is_los,range_m\nTrue,5\nFalse,5\n")});
  ASSERT_TRUE(pandas) << pandas.error().message;
  EXPECT_EQ(pandas.value().los, (std::vector<std::optional<bool>>{true, false}));
  EXPECT_EQ(pandas.value().los_value, "True");
}

TEST_F(LabelledTableTest, RefusesRangesAndTruthOfTwoUnitsAndFilesThatAreNoText) {
  const auto mixed =
      read({plain("r.csv", "nlos,range_m,true_range_m\n0,5100,5.0\n1,6900,6.0\n0,3010,3.0\n")});
  ASSERT_FALSE(mixed);
  EXPECT_NE(mixed.error().message.find("rename it to range_mm"), std::string::npos) << mixed.error().message;
  const auto cm = read({plain("c.csv", "nlos,range [cm],true_distance_cm\n0,510,500\n")});
  ASSERT_TRUE(cm) << cm.error().message;
  EXPECT_NEAR(cm.value().range_m.at(0), 5.1, 1e-12);
  EXPECT_NEAR(*cm.value().true_range_m.at(0), 5.0, 1e-12);
  const auto zip = read({plain("x.xlsx", std::string("PK\x03\x04\x14\0\6\0,1,2\n5,6,7\n", 20))});
  ASSERT_FALSE(zip);
  EXPECT_NE(zip.error().message.find("save the sheet as CSV"), std::string::npos) << zip.error().message;
}

TEST_F(LabelledTableTest, SplitsByFileWhereSeveralAreGivenAndNoColumnNamesAPlace) {
  const auto a = plain("a.csv", "range_m,rtk_range_m\n1,1\n2,2\n"),
             b = plain("b.csv", "range_m,rtk_range_m\n3,3\n");
  const auto t = read({a, b});
  ASSERT_TRUE(t);
  EXPECT_EQ(t.value().grouping, Grouping::file);
  EXPECT_EQ(t.value().group, (std::vector<std::uint32_t>{0, 0, 1}));
  EXPECT_EQ(read({a}).value().grouping, Grouping::row);
}

TEST_F(LabelledTableTest, FollowsALaterFilesOwnOrderOfColumns) {
  const auto a = plain("a.csv", "range_m,rtk_range_m\n1,1.5\n"),
             b = plain("b.csv", "bearing_rad,rtk_range_m,range_m\n0.1,3.5,3\n");
  const auto t = read({a, b});
  ASSERT_TRUE(t) << t.error().message;
  EXPECT_EQ(t.value().range_m, (std::vector<double>{1, 3}));
  EXPECT_EQ(t.value().true_range_m[1], 3.5);
  EXPECT_EQ(t.value().raw, (std::vector<double>{1, 1.5, 3, 3.5}));
  const auto lacking = read({a, plain("c.csv", "range_m\n1\n")});
  ASSERT_FALSE(lacking);
  EXPECT_NE(lacking.error().message.find("c.csv: no column rtk_range_m"), std::string::npos);
}

// Magnitudes are joined by setup and idx; the shape is that of core/nlos/cir.
TEST_F(LabelledTableTest, JoinsCirsAndDropsRowsWithoutOne) {
  std::string cir = "setup,idx";
  for (int k = 0; k < 800; ++k) cir += ",m" + std::to_string(k);
  cir += "\n4,1";
  for (int k = 0; k < 800; ++k) cir += k >= 700 && k < 710 ? ",900" : ",10";
  TableOptions options;
  options.cir = plain("cir.csv", cir + "\n");
  const auto t = read({plain("r.csv", "setup,idx,nlos,range_m\n4,0,0,5\n4,1,0,5\n")}, options);
  ASSERT_TRUE(t);
  EXPECT_EQ(t.value().rows(), 1U);
  EXPECT_NEAR(*t.value().features[0].get(nlos::Feature::early_energy), 8 / 10.0,
              0.11);  // the window begins 5 taps before the first path
  EXPECT_EQ(t.value().dropped.at("no CIR in the CIR table").first, 1U);
}

TEST_F(LabelledTableTest, LevelsThatSayThereIsNoneAreLeftOutAndCounted) {
  const auto read_rooms =
      read({plain("r.csv", k_rooms + "til,0,c,3.0,3.0,-999,-77\ntil,0,c,3.0,3.0,-75,999\n")});
  ASSERT_TRUE(read_rooms) << read_rooms.error().message;
  EXPECT_EQ(read_rooms.value().rows(), 3U);
  std::string reasons;
  for (const auto& [reason, entry] : read_rooms.value().dropped)
    reasons += reason + " at " + entry.second + "\n";
  EXPECT_NE(reasons.find("rx_dbm is no level"), std::string::npos) << reasons;
  EXPECT_NE(reasons.find("fp_dbm is no level"), std::string::npos) << reasons;
  EXPECT_NE(reasons.find("r.csv:5"), std::string::npos) << reasons;
}

TEST_F(LabelledTableTest, TwoColumnsOfOneNameAreRefusedWhereTheyAreUsedAndElseSaid) {
  const auto used = read({plain("a.csv", "env,range_m,range_m,nlos\nhw,5,6,0\n")});
  ASSERT_FALSE(used);
  EXPECT_NE(used.error().message.find("columns 2 and 3 are both named range_m"), std::string::npos)
      << used.error().message;
  const auto other = read({plain("b.csv", "env,range_m,note,note,nlos\nhw,5,6,7,0\n")});
  ASSERT_TRUE(other) << other.error().message;
  ASSERT_EQ(other.value().warnings.size(), 1U);
  EXPECT_NE(other.value().warnings[0].find("both named note"), std::string::npos);
  EXPECT_EQ(other.value().unused, (std::vector<std::string>{"note", "note"}));
}

TEST_F(LabelledTableTest, TimesOfAnotherUnitThanTheirNameAreSaid) {
  const auto said = [&](const std::string& name, const std::vector<std::string>& times) {
    std::string csv = name + ",range_m,nlos\n";
    for (const auto& t : times) csv += t + ",5,0\n";
    const auto table = read({plain("t.csv", csv)});
    EXPECT_TRUE(table);
    return table.value().warnings.empty() ? std::string() : table.value().warnings[0];
  };
  EXPECT_NE(said("t_us", {"1700000000123", "1700000000223"}).find("ms since 1970, not us"),
            std::string::npos);
  EXPECT_NE(said("t_us", {"1700000000", "1700000001"}).find("s since 1970, not us"), std::string::npos);
  EXPECT_NE(said("t_us", {"0.1", "0.2"}).find("no whole microseconds"), std::string::npos);
  EXPECT_NE(said("t_s", {"1700000000123", "1700000000223"}).find("ms since 1970, not s"), std::string::npos);
  EXPECT_EQ(said("t_us", {"1700000000123456", "1700000000223456"}), "");
  EXPECT_EQ(said("t_s", {"1700000000.5", "1700000001.5"}), "");
  EXPECT_EQ(said("t_us", {"1200000000", "1300000000"}), "") << "twenty minutes after the device began";
}

TEST_F(LabelledTableTest, ReadsTheSeparatorLineOfExcelAndRefusesUtf16) {
  const auto excel = read({plain("x.csv", "sep=;\r\nenv;range_m;nlos\r\nhw;5,5;0\r\n")});
  ASSERT_TRUE(excel) << excel.error().message;
  EXPECT_EQ(excel.value().range_m, std::vector<double>{5.5});
  const auto wide = read({plain("w.csv", std::string("\xFF\xFE"
                                                     "e\0n\0v\0\n\0",
                                                     10))});
  ASSERT_FALSE(wide);
  EXPECT_NE(wide.error().message.find("save it as CSV UTF-8"), std::string::npos) << wide.error().message;
}

TEST_F(LabelledTableTest, PlacesThatDifferInCapitalsAndRangesThatAreNoMetresAreSaid) {
  const auto table = read({plain("r.csv", "env,range_m,true_range_m,nlos\nHW,16.7,5,0\nhw,20,6,0\n")});
  ASSERT_TRUE(table);
  ASSERT_EQ(table.value().warnings.size(), 2U);
  EXPECT_NE(table.value().warnings[0].find(R"("HW", "hw")"), std::string::npos);
  EXPECT_NE(table.value().warnings[1].find("2 of 2 measured ranges"), std::string::npos);
}

}  // namespace anchord::api::labelled_table_test
