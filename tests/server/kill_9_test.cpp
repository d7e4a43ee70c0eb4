// The promise of docs/durability.md on the real binary: what was answered for is there after kill -9, once.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <fstream>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "tests/paths.hpp"
#include "tests/scratch_dir.hpp"

namespace anchord::kill_9_test {
namespace {

using SteadyClock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr int k_kills = 50;
constexpr int k_clients = 3;
constexpr int k_batch_rows = 20;
constexpr auto k_whole_test = std::chrono::seconds(85);

double seconds_since(SteadyClock::time_point start) {
  return std::chrono::duration<double>(SteadyClock::now() - start).count();
}

/// The server under test: started, killed and started again on the same folder.
class Server {
 public:
  explicit Server(std::filesystem::path dir) : data_(dir / "data"), log_(dir / "serve.log") {}
  ~Server() { kill_now(); }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Seconds until /readyz said 200; negative when it did not within ten.
  double start() {
    std::error_code ignored;
    std::filesystem::remove(data_ / "address", ignored);
    const auto begin = SteadyClock::now();
    pid_ = ::fork();
    if (pid_ == 0) run();
    while (seconds_since(begin) < 10) {
      std::string address;
      std::getline(std::ifstream(data_ / "address"), address);
      if (!address.empty()) {
        httplib::Client client(address.starts_with("http") ? address : "http://" + address);
        const auto answer = client.Get("/readyz");
        if (answer && answer->status == 200) {
          const std::lock_guard lock(mutex_);
          url_ = address.starts_with("http") ? address : "http://" + address;
          return seconds_since(begin);
        }
      }
      std::this_thread::sleep_for(milliseconds(2));
    }
    return -1;
  }
  void kill_now() {
    if (pid_ <= 0) return;
    {
      const std::lock_guard lock(mutex_);
      url_.clear();
    }
    ::kill(pid_, SIGKILL);
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
  }
  std::string url() const {
    const std::lock_guard lock(mutex_);
    return url_;
  }
  std::filesystem::path database() const { return data_ / "anchord.db"; }

 private:
  [[noreturn]] void run() const {
    const int log = ::open(log_.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    ::dup2(log, 1);
    ::dup2(log, 2);
    const std::string dir = data_.string();
    ::execl(ANCHORD_BINARY, ANCHORD_BINARY, "serve", "--listen", "127.0.0.1:0", "--auth", "off", "--data-dir",
            dir.c_str(), "--rate-per-s", "100000", "--rate-burst", "100000", static_cast<char*>(nullptr));
    ::_exit(127);
  }
  const std::filesystem::path data_, log_;
  pid_t pid_{-1};
  mutable std::mutex mutex_;
  std::string url_;
};

/// A gateway: sends its batches one after the other, each until it is answered for.
class Client {
 public:
  Client(const Server& server, std::string mission, int number)
      : server_(server), mission_(std::move(mission)), number_(number), thread_([this] { run(); }) {}
  void stop() {
    stop_ = true;
    thread_.join();
  }
  int acknowledged_batches() const { return acknowledged_; }
  int tag() const { return 100 + number_; }
  const std::string& wrong_answer() const { return wrong_; }

 private:
  void run() {
    while (!stop_ && wrong_.empty()) {
      const std::string url = server_.url();
      if (url.empty()) {
        std::this_thread::sleep_for(milliseconds(1));
        continue;
      }
      httplib::Client client(url);
      client.set_keep_alive(true);
      client.set_tcp_nodelay(true);
      while (!stop_ && send(client)) {
      }
    }
  }
  bool send(httplib::Client& client) {
    std::string body;
    for (int i = 0; i < k_batch_rows; ++i) {
      const int seq = acknowledged_ * k_batch_rows + i;
      body += R"({"t_us":)" + std::to_string(1'777'889'472'000'000 + seq * 1000LL) + R"(,"mission":")" +
              mission_ + R"(","tag":")" + std::to_string(tag()) +
              R"(","anchor":"0x6a2f","distance_m":7.5,"seq":)" + std::to_string(seq) + "}\n";
    }
    const auto answer = client.Post("/api/v1/ranges", body, "application/x-ndjson");
    if (!answer) return false;
    if (answer->status == 503) return true;
    if (answer->status != 200 || answer->body.find(R"("rejected":0)") == std::string::npos) {
      wrong_ = std::to_string(answer->status) + " " + answer->body;
      return false;
    }
    ++acknowledged_;
    return true;
  }

  const Server& server_;
  const std::string mission_;
  const int number_;
  std::atomic<int> acknowledged_{0};
  std::atomic<bool> stop_{false};
  std::string wrong_;
  std::thread thread_;
};

std::string mission_on(const Server& server) {
  httplib::Client client(server.url());
  const auto answer = client.Post("/api/v1/missions",
                                  R"({"name":"kill","frame":"wgs84","track_point":"gnss_antenna","tags":[]})",
                                  "application/json");
  if (!answer || answer->status != 201) return {};
  const auto at = answer->body.find(R"("id":")");
  return at == std::string::npos ? "" : answer->body.substr(at + 6, 36);
}

std::vector<std::string> column(sqlite3* db, const std::string& sql) {
  std::vector<std::string> found;
  const auto add = [](void* out, int, char** values, char**) {
    static_cast<std::vector<std::string>*>(out)->emplace_back(values[0] == nullptr ? "" : values[0]);
    return 0;
  };
  EXPECT_EQ(sqlite3_exec(db, sql.c_str(), add, &found, nullptr), SQLITE_OK) << sqlite3_errmsg(db);
  return found;
}

TEST(Kill9, LosesNoAcknowledgedRowAndStoresNoneTwice) {
  ScratchDir dir;
  Server server(dir.path());
  const auto begin = SteadyClock::now();
  ASSERT_GE(server.start(), 0) << "the server did not get ready";
  const std::string mission = mission_on(server);
  ASSERT_EQ(mission.size(), 36u);

  std::vector<std::unique_ptr<Client>> clients;
  for (int i = 0; i < k_clients; ++i) clients.push_back(std::make_unique<Client>(server, mission, i));
  std::mt19937 random(11);
  std::vector<double> restarts_s;
  int kills = 0;
  for (; kills < k_kills && SteadyClock::now() - begin < k_whole_test; ++kills) {
    std::this_thread::sleep_for(milliseconds(5 + random() % 350));  // the random moment itself
    server.kill_now();
    restarts_s.push_back(server.start());
    ASSERT_GE(restarts_s.back(), 0) << "not ready after kill " << kills;
  }
  for (auto& client : clients) client->stop();
  server.kill_now();
  EXPECT_EQ(kills, k_kills) << "too slow a machine for all of them";

  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(server.database().c_str(), &db), SQLITE_OK);
  EXPECT_EQ(column(db, "PRAGMA integrity_check"), std::vector<std::string>{"ok"});
  int acknowledged = 0;
  for (const auto& client : clients) {
    EXPECT_EQ(client->wrong_answer(), "");
    const int rows = client->acknowledged_batches() * k_batch_rows;
    acknowledged += rows;
    const auto seqs = column(
        db, "SELECT seq FROM uwb_range WHERE tag = " + std::to_string(client->tag()) + " ORDER BY seq");
    // Every acknowledged number, each once; perhaps the batch whose answer was lost, whole.
    ASSERT_GE(seqs.size(), static_cast<std::size_t>(rows));
    ASSERT_LE(seqs.size(), static_cast<std::size_t>(rows + k_batch_rows));
    EXPECT_EQ(seqs.size() % k_batch_rows, 0u) << "half a batch";
    for (std::size_t i = 0; i < seqs.size(); ++i) ASSERT_EQ(seqs[i], std::to_string(i));
  }
  sqlite3_close(db);
  EXPECT_GT(acknowledged, k_kills * k_batch_rows) << "hardly anything was written: the test proves nothing";
  std::ranges::sort(restarts_s);
  std::printf("%d kills, %d rows acknowledged, restart to ready: median %.3f s, worst %.3f s\n", kills,
              acknowledged, restarts_s[restarts_s.size() / 2], restarts_s.back());
  EXPECT_LT(restarts_s[restarts_s.size() / 2], 1.0);
  // Nine in ten: the machine of a test runs other tests beside this one.
  EXPECT_LT(restarts_s[restarts_s.size() * 9 / 10], 1.0);
}

}  // namespace
}  // namespace anchord::kill_9_test
