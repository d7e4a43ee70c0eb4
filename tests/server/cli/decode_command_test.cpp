// The real binary, as somebody with a log in hand calls it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "tests/paths.hpp"

namespace anchord::decode_command_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

std::string sentence(const std::string& text) {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  char tail[8];
  std::snprintf(tail, sizeof tail, "*%02X\r\n", sum);
  return "$" + text + tail;
}

struct Answer {
  int exit_code{};
  std::string out, err;
};

class DecodeCommand : public testing::Test {
 protected:
  // A space in the path, on purpose; one folder per test, since tests run side by side.
  fs::path folder_ =
      fs::path(testing::TempDir()) /
      ("anchord decode " + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string quoted(const char* name) const { return "'" + (folder_ / name).string() + "'"; }
  /// The whole of what is behind `anchord decode`, redirections included.
  Answer run(const std::string& arguments) const {
    const auto command = std::string("'") + ANCHORD_BINARY + "' decode " + arguments;
    const int status =
        std::system(("{ " + command + " ; } >" + quoted("out") + " 2>" + quoted("err")).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text_of(folder_ / "out"), text_of(folder_ / "err")};
  }
  Answer decode(const std::string& log, const std::string& arguments = "") const {
    std::ofstream(folder_ / "log", std::ios::binary) << log;
    return run(arguments + " " + quoted("log"));
  }
};

// The example of the NMEA notes: 51 deg 1.3687380 min is 51.0228123 deg, 22.5 + 45.012 is 67.512 m.
const std::string k_epoch =
    sentence("GNRMC,090000.20,A,5101.3687380,N,00342.6274020,E,0.70,109.44,130624,,,D") +
    sentence("GNGGA,090000.20,5101.3687380,N,00342.6274020,E,4,14,0.9,22.500,M,45.012,M,0.8,0000") +
    sentence("GNGST,090000.20,0.231,0.021,0.012,35.2,0.014,0.009,0.021");

TEST_F(DecodeCommand, PrintsEveryFieldInBothForms) {
  const auto csv = decode(k_epoch);
  EXPECT_EQ(csv.exit_code, 0);
  EXPECT_EQ(
      csv.out,
      "t_utc,lat_deg,lon_deg,height_ellipsoid_m,height_msl_m,fix,sats,age_s,sigma_e_m,sigma_n_m,"
      "sigma_u_m,hdop\n"
      "2024-06-13T09:00:00.200000Z,51.022812300,3.710456700,67.5120,22.5000,fixed,14,0.80,0.0140,0.0140,"
      "0.0210,0.90\n");
  EXPECT_THAT(csv.err, HasSubstr("1 epochs from 3 nmea frames of "));
  EXPECT_THAT(csv.err, HasSubstr("fix: 1 fixed\n"));
  EXPECT_THAT(csv.err, Not(HasSubstr("skipped")));
  EXPECT_EQ(decode(k_epoch, "--json").out,
            "{\"t_utc\":\"2024-06-13T09:00:00.200000Z\",\"lat_deg\":51.022812300,\"lon_deg\":3.710456700,"
            "\"height_ellipsoid_m\":67.5120,\"height_msl_m\":22.5000,\"fix\":\"fixed\",\"sats\":14,"
            "\"age_s\":0.80,\"sigma_e_m\":0.0140,\"sigma_n_m\":0.0140,\"sigma_u_m\":0.0210,\"hdop\":0.90}\n");
}

TEST_F(DecodeCommand, LeavesWhatIsUnknownEmptyOrNull) {
  const auto log = sentence("GNGGA,,,,,,0,00,99.99,,,,,,");
  EXPECT_THAT(decode(log).out, HasSubstr("\n,,,,,none,0,,,,,99.99\n"));
  const auto json = decode(log, "--json");
  EXPECT_THAT(json.out, HasSubstr("{\"t_utc\":null,\"lat_deg\":null,"));
  EXPECT_THAT(json.err, HasSubstr("1 epochs without a time"));
}

TEST_F(DecodeCommand, SaysWhatWasSkippedAndWhere) {
  std::string wrong = k_epoch;
  wrong[12] = '9';  // a digit of the RMC's time
  const auto answer = decode(wrong, "--date 2024-06-13");
  EXPECT_THAT(answer.err, HasSubstr("skipped: nmea: checksum wrong: 1, first at byte 0: $GNRMC,"));
  EXPECT_THAT(answer.out, HasSubstr("2024-06-13T09:00:00.200000Z"));
  EXPECT_THAT(
      decode(sentence("GNGGA,250000.00,,,,,0,00,,,,,,,")).err,
      HasSubstr("skipped: nmea: field not readable: 1, first at byte 0: field 1 '250000.00': GNGGA,"));
}

TEST_F(DecodeCommand, TellsWhyThereIsNothing) {
  for (const auto& [log, arguments, why] :
       {std::tuple<std::string, const char*, const char*>{"", "", "the input is empty"},
        {sentence("GPHDT,12.3,T"), "", "1 nmea frames of 18 bytes\nno position among them"},
        {"once upon a time\n", "", "it contains no NMEA, UBX, ERB, LLH or gpsd JSON"},
        {k_epoch, "--format ubx", "it contains nothing of this format: --format auto accepts all formats"},
        {std::string("\xff\xfe$\0G\0", 6), "", "UTF-16"}}) {
    const auto answer = decode(log, arguments);
    EXPECT_EQ(answer.exit_code, 1) << why;
    EXPECT_THAT(answer.err, HasSubstr(why));
  }
}

TEST_F(DecodeCommand, SaysThatTwoFormatsTellTheSame) {
  const auto answer =
      decode(k_epoch + "2024/06/13 09:00:00.200 51.0 3.7 67.5 1 14 0.01 0.01 0.02 0 0 0 0.8 12.5\n");
  EXPECT_THAT(answer.err, HasSubstr("epochs in several formats (1 nmea, 1 llh)"));
  EXPECT_THAT(answer.err, HasSubstr("llh: 1 lines before any header that names the time system"));
}

TEST_F(DecodeCommand, ReadsLlhWithoutAHeaderInTheSystemItIsGiven) {
  const std::string line = "2024/06/13 09:00:18.200 51.0 3.7 67.5 1 14 0.01 0.01 0.02 0 0 0 0.8 12.5\n";
  EXPECT_THAT(decode(line).out, HasSubstr("T09:00:18.200000Z"));
  EXPECT_THAT(decode(line, "--llh-time gpst").out, HasSubstr("T09:00:00.200000Z"));  // 18 s in 2024
}

TEST_F(DecodeCommand, FailsWithTwoWhereItCannotReadOrWrite) {
  const auto missing = run(quoted("nothing here"));
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.err, HasSubstr("cannot read"));
  EXPECT_THAT(missing.err, HasSubstr("No such file"));
  EXPECT_EQ(run("'" + folder_.string() + "'").exit_code, 2);  // a folder opens, but does not read
  EXPECT_EQ(run("--date tomorrow " + quoted("nothing here")).exit_code, 2);
  std::ofstream(folder_ / "log", std::ios::binary) << k_epoch;
  const auto full = run(quoted("log") + " >/dev/full");
  EXPECT_EQ(full.exit_code, 2);
  EXPECT_THAT(full.err, HasSubstr("cannot write the output"));
}

TEST_F(DecodeCommand, ReadsAPipeCutAnywhere) {
  std::ofstream(folder_ / "log", std::ios::binary) << k_epoch;
  // dd writes each of its small blocks by itself.
  std::ofstream(folder_ / "pipe.sh") << "dd if=" << quoted("log") << " bs=7 2>/dev/null | '" << ANCHORD_BINARY
                                     << "' decode -\n";
  const int status =
      std::system(("sh " + quoted("pipe.sh") + " >" + quoted("piped") + " 2>/dev/null").c_str());
  EXPECT_EQ(status, 0);
  EXPECT_EQ(text_of(folder_ / "piped"), decode(k_epoch).out);
}

}  // namespace
}  // namespace anchord::decode_command_test
