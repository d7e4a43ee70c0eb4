// The one reader of separated cells. Expectations are of RFC 4180, sections 2.4 to 2.7.
#include "api/formats/csv_record.hpp"

#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <filesystem>
#include <fstream>

#include "api/formats/csv_table.hpp"

namespace anchord::api::csv_record_test {
namespace {

using Cells = std::vector<std::string>;

/// Every record of a text; the error's words in place of what cannot be read.
std::vector<Cells> records(std::string_view text, CsvForm form = {}) {
  std::vector<Cells> out;
  CsvRecord record(form);
  while (true) {
    const auto more = record.take(text);
    if (!more) {
      out.push_back({more.error().message});
      return out;
    }
    if (!more.value()) return out;
    out.emplace_back(record.cells().begin(), record.cells().end());
  }
}

TEST(CsvRecord, SplitsAtTheSeparatorAndKeepsEmptyCells) {
  EXPECT_EQ(records("a,b,c\n1,,3\r\n,,\n"),
            (std::vector<Cells>{{"a", "b", "c"}, {"1", "", "3"}, {"", "", ""}}));
  EXPECT_EQ(records("a;b,c\t", {';'}), (std::vector<Cells>{{"a", "b,c"}}));
  EXPECT_EQ(records("a\t\tc\n", {'\t'}), (std::vector<Cells>{{"a", "", "c"}}));
  EXPECT_EQ(records("one"), (std::vector<Cells>{{"one"}}));
  EXPECT_EQ(records("a,"), (std::vector<Cells>{{"a", ""}}));
  EXPECT_EQ(records(""), (std::vector<Cells>{}));
  EXPECT_EQ(records("\n\na\n"), (std::vector<Cells>{{""}, {""}, {"a"}}));
}

TEST(CsvRecord, ReadsQuotedCellsWithSeparatorsLineEndsAndQuotesInThem) {
  EXPECT_EQ(records("\"hall, north\",\"5\"\" pipe\",\"two\r\nlines\",\"\"\nb,c,d,e"),
            (std::vector<Cells>{{"hall, north", "5\" pipe", "two\r\nlines", ""}, {"b", "c", "d", "e"}}));
  EXPECT_EQ(records("\"\"\"\",x\r"), (std::vector<Cells>{{"\"", "x"}}));
  EXPECT_EQ(records("5\" pipe,x"), (std::vector<Cells>{{"5\" pipe", "x"}})) << "a quote within a bare cell";
}

TEST(CsvRecord, TrimsRoundCellsAndNotWithinTheirQuotes) {
  EXPECT_EQ(records(" a ,\t\" b \" , c d \n"), (std::vector<Cells>{{"a", " b ", "c d"}}));
  EXPECT_EQ(records(" a ,b\n", {',', false}), (std::vector<Cells>{{" a ", "b"}}));
}

TEST(CsvRecord, RefusesAQuoteThatIsNotClosedAndTextBehindOneThatIs) {
  EXPECT_EQ(records("a,\"b\nc,d\n"), (std::vector<Cells>{{"a quote is not closed: \"b\nc,d\n"}}));
  EXPECT_EQ(records("\"a\"b,c\n"), (std::vector<Cells>{{"text after a closing quote: b,c\n"}}));
  EXPECT_EQ(records("\""), (std::vector<Cells>{{"a quote is not closed: \""}}));
  const auto long_one = records("\"" + std::string(100'000, 'x'));
  EXPECT_LT(long_one.at(0).at(0).size(), 100u);
}

TEST(CsvRecord, EndsAtEveryCutOfAText) {
  const std::string text = "a,\"b \"\" c\",d\r\n\"x\ny\",,\n";
  for (std::size_t n = 0; n <= text.size(); ++n) {
    std::string_view rest = std::string_view(text).substr(0, n);
    CsvRecord record;
    while (!rest.empty()) {
      const auto left = rest.size();
      if (!record.take(rest)) break;
      ASSERT_LT(rest.size(), left) << "no step forward at " << n;
    }
  }
}

TEST(CsvRecord, ReadsALineAsOneRecordEvenAnEmptyOne) {
  CsvRecord record;
  ASSERT_TRUE(record.read(""));
  EXPECT_EQ(record.cells().size(), 1u);
  ASSERT_TRUE(record.read("a,\"b,c\""));
  EXPECT_EQ(record.cells()[1], "b,c");
  EXPECT_FALSE(record.read("a\nb"));
}

class CsvFile : public ::testing::Test {
 protected:
  void SetUp() override {
    char path[] = "/tmp/anchord_csv_XXXXXX";
    ASSERT_NE(mkdtemp(path), nullptr);
    folder_ = path;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string first_error(const std::string& text) {
    std::ofstream(folder_ / "t.csv", std::ios::binary) << text;
    auto table = CsvTable::open(folder_, "t");
    if (!table) return table.error().message;
    while (true) {
      const auto more = table.value().next();
      if (!more) return more.error().message;
      if (!more.value()) return "";
    }
  }
  std::filesystem::path folder_;
};

TEST_F(CsvFile, NamesFileAndLineOfWhatIsWrong) {
  const std::string file = (folder_ / "t.csv").string();
  EXPECT_EQ(first_error("a,b\n1,2\n3\n"), file + ":3: 1 fields, the header has 2");
  EXPECT_EQ(first_error("a,b\n\n1,\"2\n"), file + ":3: a quote is not closed: \"2");
  EXPECT_EQ(first_error("a,a\n"), file + ":1: column 'a' occurs twice");
  EXPECT_EQ(first_error(""), file + ": empty, expected a header line");
  EXPECT_EQ(first_error("\xEF\xBB\xBF"
                        "a,b\r\n\"1\",2\r\n"),
            "");
}

TEST_F(CsvFile, RefusesALineWithoutEnd) {
  EXPECT_NE(first_error("a\n" + std::string(3 << 20, '1')).find("longer than 1 MiB"), std::string::npos);
}

}  // namespace
}  // namespace anchord::api::csv_record_test
