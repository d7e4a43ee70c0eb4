// A worker that dies, in every way it may: the work gets a cause and advice, and the caller lives.
#include "server/runtime/worker_process.hpp"
#include "core/base/base64.hpp"
#include "core/floor_plan/image.hpp"
#include "server/runtime/file_sandbox.hpp"
#include "tests/core/floor_plan/pictures.hpp"
#include "tests/paths.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/landlock.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace anchord::server::worker_process_test {
namespace {

class WorkerProcess : public testing::Test {
 protected:
  void SetUp() override {
    char path[] = "/tmp/anchord_worker_XXXXXX";
    ASSERT_NE(mkdtemp(path), nullptr);
    dir_ = path;
  }
  void TearDown() override { std::filesystem::remove_all(dir_); }

  Result<std::string> run(
      const std::string& script, const std::string& message,
      const std::function<bool()>& canceled = [] { return false; }) const {
    const auto program = dir_ / "program";
    std::ofstream{program} << "#!/bin/sh\n" << script << '\n';
    ::chmod(program.c_str(), 0755);
    return work_in_process(program)(message, {}, canceled);
  }
  /// Asked five times, the caller wants it no more. The script outlives every test that waits for it.
  Result<std::string> canceled_while(const std::string& script, const std::string& message) const {
    int n_asked = 0;
    return run(script + "; exec sleep 600", message, [&n_asked] { return ++n_asked > 5; });
  }
  /// The worker sends one frame, 4 bytes of length and a text, over the socket that is its input.
  Result<std::string> says(const std::string& text) const {
    char size[20];
    std::snprintf(size, sizeof size, "\\%03o\\000\\000\\000", static_cast<unsigned>(text.size()));
    return run("printf '" + std::string(size) + text + "' >&0; sleep 1", "{}");
  }

  std::filesystem::path dir_;
};

/// A forest on `rows` rows of two places.
std::string training(std::size_t rows) {
  std::string csv =
      "feature_set,campaign,environment,setting,split,los,true_range_m,repeats,range_m,rx_dbm\n";
  for (std::size_t i = 0; i < rows; ++i)
    csv += "anchord-features-2,c,room " + std::to_string(i % 4) + ",s" + std::to_string(i) + ",train," +
           (i % 2 == 0 ? "1" : "0") + ",5,1," + std::to_string(5 + static_cast<double>(i % 97) / 100) + "," +
           std::to_string(-80 - static_cast<double>(i % 13)) + "\n";
  return nlohmann::json{
      {"kind", "training"},
      {"csv", csv},
      {"request", {{"task", "nlos_id"}, {"dataset", "x"}, {"methods", {"logistic"}}, {"importance", false}}}}
      .dump();
}

}  // namespace

TEST_F(WorkerProcess, AKilledWorkerIsToldAsAlmostCertainlyOutOfMemory) {
  const auto result = run("kill -KILL $$", "{}");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::link_lost);
  EXPECT_NE(result.error().message.find("was ended by signal 9"), std::string::npos)
      << result.error().message;
  EXPECT_NE(result.error().message.find("no memory left"), std::string::npos) << result.error().message;
}

TEST_F(WorkerProcess, IsCanceledThoughItNeverReadsItsMessage) {
  const auto result = canceled_while(":", std::string(8 << 20, 'x'));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::canceled);
}

TEST_F(WorkerProcess, IsCanceledThoughItStandsStillInTheMiddleOfAnAnswer) {
  for (const char* part : {"\\144\\000", "\\144\\000\\000\\000{", "\\144\\000\\000\\000{\"op\":"}) {
    const auto result = canceled_while("printf '" + std::string(part) + "' >&0", "{}");
    ASSERT_FALSE(result) << part;
    EXPECT_EQ(result.error().code, Errc::canceled) << part;
  }
}

TEST_F(WorkerProcess, ReadsAnAnswerThatComesInPieces) {
  const auto result =
      run("printf '\\015\\000' >&0; sleep 0.2; printf '\\000\\000{\"op\":\"d' >&0; sleep 0.2; "
          "printf 'one\"}\\004\\000\\000\\000go' >&0; sleep 0.2; printf 'od' >&0; sleep 1",
          "{}");
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result.value(), "good");
}

TEST_F(WorkerProcess, ACrashedWorkerSaysThatTheRunIsKeptAndWhatToTry) {
  const auto result = run("kill -SEGV $$", "{}");
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("fewer rows or another method"), std::string::npos)
      << result.error().message;
}

TEST_F(WorkerProcess, RunsOutOfMemoryWithTheLimitInTheMessageInsteadOfAFaultWithoutWords) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's shadow counts as data: no limit is set";
#endif
  const std::string real = "exec '" ANCHORD_BINARY "' worker";
  ASSERT_TRUE(run(real, training(200))) << "the work itself is sound";
  const auto result = run("ulimit -d 60000; " + real, training(200'000));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::unsupported) << result.error().message;
  EXPECT_NE(result.error().message.find("more memory than the 58 MiB"), std::string::npos)
      << result.error().message;
  EXPECT_NE(result.error().message.find("fewer"), std::string::npos) << result.error().message;
}

TEST_F(WorkerProcess, AWorkerThatAnswersNonsenseIsAFailureAndNeverOurs) {
  for (const char* text :
       {"no JSON", "[]", R"({"op":7})", R"({"op":"failed","code":"x","message":3})",
        R"({"op":"failed","code":99999})", R"({"op":"failed","code":-1})", R"({"op":"progress","stage":7})",
        R"({"op":"progress","fraction":"half"})", R"({"op":"progress","stage_index":-1})"}) {
    const auto result = says(text);
    ASSERT_FALSE(result) << text;
    EXPECT_EQ(result.error().code, Errc::internal) << text;
    EXPECT_NE(result.error().message.find("cannot be read"), std::string::npos) << result.error().message;
  }
}

TEST_F(WorkerProcess, TakesTheCodeOfAnErrorByItsWordAndGuessesNone) {
  const auto known = says(R"({"op":"failed","code":"conflict","message":"m"})");
  ASSERT_FALSE(known);
  EXPECT_EQ(known.error().code, Errc::conflict);
  EXPECT_EQ(known.error().message, "m");
  // The number that conflict has in this version may be another error in the worker's.
  for (const char* text :
       {R"({"op":"failed","code":6,"message":"m"})", R"({"op":"failed","code":"out_of_luck","message":"m"})",
        R"({"op":"failed","message":"m"})"}) {
    const auto unknown = says(text);
    ASSERT_FALSE(unknown) << text;
    EXPECT_EQ(unknown.error().code, Errc::internal) << text;
    EXPECT_NE(unknown.error().message.find("m"), std::string::npos) << unknown.error().message;
    EXPECT_NE(unknown.error().message.find("unknown code"), std::string::npos) << unknown.error().message;
  }
}

/// A picture of 4 x 3 pixels as the server sends it.
std::string plan_message(const std::string& picture) {
  return R"(floor_plan {"task":"inspect","enu_from_pixel":[1,0,0,0,-1,0]})"
         "\n" +
         picture;
}

TEST_F(WorkerProcess, DecodesThePictureOfAFloorPlan) {
  const std::string real = "exec '" ANCHORD_BINARY "' worker";
  const auto result = run(real, plan_message(floor_plan::tiff(false, false)));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(nlohmann::json::parse(result.value())["width_px"], 4);
  const auto bomb = run(real, plan_message(floor_plan::png_head(50'000, 50'000)));
  ASSERT_FALSE(bomb);
  EXPECT_EQ(bomb.error().code, Errc::invalid_argument);
  const auto half = run(real, plan_message(floor_plan::png_head(400, 300)));
  ASSERT_FALSE(half);
  EXPECT_EQ(half.error().code, Errc::bad_frame);
}

TEST_F(WorkerProcess, GivesBackTheTilesOfAPlanByteForByte) {
  const auto picture = floor_plan::tiff(false, false);
  const std::string head = R"(floor_plan {"task":"tiles","enu_from_pixel":[1,0,0,0,-1,0]})";
  const auto result = run("exec '" ANCHORD_BINARY "' worker", head + '\n' + picture);
  ASSERT_TRUE(result) << result.error().message;
  const auto& text = result.value();
  const auto line_end = text.find('\n');
  const auto told = nlohmann::json::parse(text.substr(0, line_end));
  ASSERT_EQ(told["tiles"].size(), 1u);
  const auto png = text.substr(line_end + 1);
  EXPECT_EQ(told["tiles"][0], (nlohmann::json{0, 0, 0, png.size()}));
  const auto tile = floor_plan::decode_image(std::as_bytes(std::span(png)));
  ASSERT_TRUE(tile) << tile.error().message;
  EXPECT_EQ(tile.value().pixels[3], 0x40) << "as in the picture";
}

TEST_F(WorkerProcess, WhatDiesBetweenItsLastWordAndItsResultHasNone) {
  const auto result = says(R"({"op":"done"})");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::link_lost) << result.error().message;
}

/// A PDF 1.4 by hand; object 1 is its catalogue.
std::string pdf_of(const std::vector<std::string>& objects, const std::string& trailer = {}) {
  std::string out = "%PDF-1.4\n", table;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    char entry[32];
    std::snprintf(entry, sizeof entry, "%010zu 00000 n \n", out.size());
    table += entry;
    out += std::to_string(i + 1) + " 0 obj\n" + objects[i] + "\nendobj\n";
  }
  const auto at = out.size(), size = objects.size() + 1;
  return out + "xref\n0 " + std::to_string(size) + "\n0000000000 65535 f \n" + table + "trailer<</Size " +
         std::to_string(size) + "/Root 1 0 R" + trailer + ">>\nstartxref\n" + std::to_string(at) +
         "\n%%EOF\n";
}
/// Two pages: A4 across with a black bar of 300 x 8 points, 100 points from the left and from below; and one
/// of so many inches, turned by 90 degrees.
std::string two_pages(int inches) {
  const std::string size = std::to_string(72 * inches);
  return pdf_of({"<</Type/Catalog/Pages 2 0 R>>", "<</Type/Pages/Kids[3 0 R 5 0 R]/Count 2>>",
                 "<</Type/Page/Parent 2 0 R/MediaBox[0 0 842 595]/Contents 4 0 R>>",
                 "<</Length 29>>stream\n0 0 0 rg 100 100 300 8 re f  \nendstream",
                 "<</Type/Page/Parent 2 0 R/MediaBox[0 0 " + size + " 72]/Rotate 90/Contents 4 0 R>>"});
}
std::string page_message(const std::string& pdf, int page, int dpi = 100, int cpu_s = 30) {
  return R"(floor_plan page {"task":"page","enu_from_pixel":[1,0,0,0,-1,0],"page":)" + std::to_string(page) +
         R"(,"dots_per_inch":)" + std::to_string(dpi) + R"(,"cpu_s":)" + std::to_string(cpu_s) + "}\n" + pdf;
}
/// A page that draws a form ten times, which draws another ten times, and so on: 10^12 lines in 3 kB.
std::string form_bomb() {
  constexpr int k_depth = 12;
  const auto stream = [](const std::string& keys, const std::string& text) {
    return "<<" + keys + "/Length " + std::to_string(text.size()) + ">>stream\n" + text + "\nendstream";
  };
  const auto draws = [](int object) {
    return "/Resources<</XObject<</F " + std::to_string(object) + " 0 R>>>>";
  };
  std::vector<std::string> objects{
      "<</Type/Catalog/Pages 2 0 R>>", "<</Type/Pages/Kids[3 0 R]/Count 1>>",
      "<</Type/Page/Parent 2 0 R/MediaBox[0 0 842 595]/Contents 4 0 R" + draws(5) + ">>",
      stream("", "/F Do")};
  for (int level = 0; level < k_depth; ++level) {
    const bool last = level + 1 == k_depth;
    std::string text;
    for (int i = 0; i < 10; ++i) text += last ? "0 0 m 800 500 l S " : "/F Do ";
    objects.push_back(stream(
        "/Type/XObject/Subtype/Form/BBox[0 0 842 595]" + (last ? std::string() : draws(6 + level)), text));
  }
  return pdf_of(objects);
}

TEST_F(WorkerProcess, DrawsAPageOfAPdfByPopplerAndRefusesWhatIsNone) {
  const std::string real = "exec '" ANCHORD_BINARY "' worker";
  const auto drawn = run(real, page_message(two_pages(10), 1));
  ASSERT_TRUE(drawn) << drawn.error().message;
  const auto json = nlohmann::json::parse(drawn.value());
  EXPECT_EQ(json["pages"], 2);
  const auto png = from_base64(json["png"].get<std::string>());
  const auto image = floor_plan::decode_image(std::as_bytes(std::span(*png))).value();
  EXPECT_NEAR(image.width_px, 842 / 0.72, 1);
  EXPECT_NEAR(image.height_px, 595 / 0.72, 1);
  const auto ink = [&](double x_pt, double y_pt) {  // from below, as in the file
    const auto x = static_cast<int>(x_pt / 0.72), y = image.height_px - static_cast<int>(y_pt / 0.72);
    return image.pixels[static_cast<std::size_t>(3 * (y * image.width_px + x))];
  };
  EXPECT_LT(ink(250, 104), 20);
  EXPECT_GT(ink(250, 120), 235);
  EXPECT_GT(ink(90, 104), 235);
  const auto turned = run(real, page_message(two_pages(10), 2));
  ASSERT_TRUE(turned) << turned.error().message;

  const auto none = run(real, page_message(two_pages(10), 3));
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("no page 3"), std::string::npos) << none.error().message;
  const auto huge = run(real, page_message(two_pages(1'000'000), 2));
  ASSERT_FALSE(huge);
  EXPECT_NE(huge.error().message.find("of paper"), std::string::npos) << huge.error().message;
  const auto broken = run(real, page_message(two_pages(10).substr(0, 60), 1));
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().code, Errc::bad_frame);
  EXPECT_NE(broken.error().message.find("pdfinfo failed"), std::string::npos) << broken.error().message;
  EXPECT_NE(broken.error().message.find("export the PDF again"), std::string::npos) << broken.error().message;
}

TEST_F(WorkerProcess, HostilePdfsAreRefusedOrDrawnWithoutWhatTheyAskFor) {
  const std::string real = "exec '" ANCHORD_BINARY "' worker", catalog = "<</Type/Catalog/Pages 2 0 R>>",
                    tree = "<</Type/Pages/Kids[3 0 R]/Count 1>>",
                    page = "<</Type/Page/Parent 2 0 R/MediaBox[0 0 72 72]";
  const std::string id = "<00112233445566778899aabbccddeeff>";
  const std::string locked = "/ID[" + id + id + "]/Encrypt<</Filter/Standard/V 2/R 3/Length 128/P -4/O<" +
                             std::string(64, '1') + ">/U<" + std::string(64, '2') + ">>>";
  const struct {
    std::string what, pdf;
    int page;
  } refused[] = {
      {"a page tree that is its own child", pdf_of({catalog, "<</Type/Pages/Kids[2 0 R]/Count 999999>>"}), 1},
      {"a count that is too high", pdf_of({catalog, "<</Type/Pages/Kids[3 0 R]/Count 999>>", page + ">>"}),
       500},
      {"a password", pdf_of({catalog, tree, page + ">>"}, locked), 1},
  };
  for (const auto& [what, pdf, number] : refused) {
    const auto answer = run(real, page_message(pdf, number));
    ASSERT_FALSE(answer) << what;
    EXPECT_TRUE(answer.error().code == Errc::bad_frame || answer.error().code == Errc::invalid_argument)
        << what << ": " << answer.error().message;
  }
  const std::pair<std::string, std::string> drawn[] = {
      {"a script and a program",
       pdf_of({"<</Type/Catalog/Pages 2 0 R/OpenAction<</S/JavaScript/JS(app.alert\\(1\\))>>>>", tree,
               page + "/AA<</O<</S/Launch/F(/bin/sh)>>>>>>"})},
      {"contents in a file of the machine", pdf_of({catalog, tree, page + "/Contents 4 0 R>>",
                                                    "<</Length 0/F(/etc/passwd)>>stream\n\nendstream"})},
  };
  for (const auto& [what, pdf] : drawn) {
    const auto answer = run(real, page_message(pdf, 1));
    ASSERT_TRUE(answer) << what << ": " << answer.error().message;
    const auto png = from_base64(nlohmann::json::parse(answer.value())["png"].get<std::string>());
    const auto image = floor_plan::decode_image(std::as_bytes(std::span(*png))).value();
    EXPECT_EQ(std::ranges::count(image.pixels, 255), std::ranges::ssize(image.pixels))
        << what << ": not blank";
  }
}

TEST_F(WorkerProcess, APageThatWouldBeDrawnForeverEndsWithItsProcessorTimeAndSaysWhatToDo) {
  const std::string real = "exec '" ANCHORD_BINARY "' worker";
  const auto bomb = run(real, page_message(form_bomb(), 1, 100, 1));
  ASSERT_FALSE(bomb);
  EXPECT_EQ(bomb.error().code, Errc::no_convergence) << bomb.error().message;
  EXPECT_NE(bomb.error().message.find("pdftoppm used up 1 s of processor time"), std::string::npos)
      << bomb.error().message;
  EXPECT_NE(bomb.error().message.find("export the page as PNG"), std::string::npos) << bomb.error().message;
}

TEST_F(WorkerProcess, ADecoderThatWorksOnAndOnIsEndedByItsProcessorTimeAndNotCalledOutOfMemory) {
  const std::string real = "exec '" ANCHORD_BINARY "' worker";
  std::string message = plan_message(floor_plan::jpeg_of_scans(9'600, 480));
  message.insert(message.find("\"enu"), R"("cpu_s":1,)");
  const auto bomb = run(real, message);
  ASSERT_FALSE(bomb);
  EXPECT_EQ(bomb.error().code, Errc::no_convergence) << bomb.error().message;
  EXPECT_NE(bomb.error().message.find("more than 1 s of processor time"), std::string::npos)
      << bomb.error().message;
}

TEST_F(WorkerProcess, APageWithoutItsMarkRunsNoProgram) {
  auto message = page_message(two_pages(10), 1);
  message.erase(message.find("page "), 5);  // settled as for any other picture
  const auto refused = run("exec '" ANCHORD_BINARY "' worker", message);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
}

TEST(FileSandbox, ShowsTheSystemsFilesAndNoOthers) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    see_system_files_only();
    const bool sees_system = ::open("/usr/bin/env", O_RDONLY) >= 0,
               sees_own = ::open("/etc/passwd", O_RDONLY) >= 0;
    const bool writes = ::open("/tmp/anchord_sandbox_test", O_WRONLY | O_CREAT, 0600) >= 0;
    _exit((sees_system ? 1 : 0) + (sees_own ? 2 : 0) + (writes ? 4 : 0));
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  // Without Landlock in the kernel nothing is held back; the kernel is asked, not what is tested.
  const bool has_landlock =
      ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION) >= 1;
  EXPECT_EQ(WEXITSTATUS(status), has_landlock ? 1 : 7);
}

TEST_F(WorkerProcess, ADecoderThatDiesSaysNothingOfTraining) {
  const auto result = run("kill -SEGV $$", plan_message("x"));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::link_lost);
  EXPECT_NE(result.error().message.find("a fault of the decoder"), std::string::npos)
      << result.error().message;
}

}  // namespace anchord::server::worker_process_test
