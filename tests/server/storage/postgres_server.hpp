#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <pwd.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "server/storage/postgres_connection.hpp"
#include "tests/scratch_dir.hpp"

namespace anchord {

/// A PostgreSQL of our own in a folder that goes away, reached by a socket in that folder. It runs as an
/// ordinary user, for it refuses to be root, and ends with the process.
class PostgresServer {
 public:
  static constexpr const char* k_programs = "/usr/lib/postgresql/15/bin";
  static bool installed() { return std::filesystem::exists(std::string(k_programs) + "/initdb"); }

  PostgresServer() {
    if (::geteuid() == 0) {
      const auto* who = ::getpwnam("postgres");
      if (who == nullptr) who = ::getpwnam("nobody");
      uid_ = who->pw_uid;
      gid_ = who->pw_gid;
      EXPECT_EQ(::chown(dir_.path().c_str(), uid_, gid_), 0);
    }
    const int made = wait_for(start({"initdb", "-D", data(), "-A", "trust", "-U", "anchord", "-E", "UTF8",
                                     "--no-locale", "--no-sync", "--no-instructions"}));
    EXPECT_EQ(made, 0) << "initdb failed: " << dir_.path() / "log";
    begin();
  }
  ~PostgresServer() { end(SIGINT); }
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;

  void begin() {
    pid_ = start({"postgres", "-D", data(), "-c", "listen_addresses=", "-c",
                  "unix_socket_directories=" + dir_.path().string(), "-c", "fsync=off", "-c",
                  "max_connections=200"});
    for (int i = 0; i < 400; ++i) {
      try {
        const sql::PostgresConnection there(address("postgres"));
        return;
      } catch (const sql::SqlError&) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      }
    }
    ADD_FAILURE() << "PostgreSQL did not start within 20 s: " << dir_.path() / "log";
  }
  /// SIGINT: sessions are cut off, and the database is whole. SIGQUIT: as if it crashed.
  void end(int signal) {
    if (pid_ > 0) {
      ::kill(pid_, signal);
      wait_for(pid_);
    }
    pid_ = -1;
  }

  /// SIGSTOP, and later SIGCONT, to the server and every session: connections stay and nothing is answered.
  void signal_all(int signal) const {
    ::kill(pid_, signal);
    const auto id = std::to_string(pid_);
    std::ifstream children("/proc/" + id + "/task/" + id + "/children");
    for (pid_t child = 0; children >> child;) ::kill(child, signal);
  }

  std::string address(const std::string& database) const {
    return "postgresql://anchord@/" + database + "?host=" + dir_.path().string();
  }
  void execute(const std::string& sql) const { sql::PostgresConnection(address("postgres")).execute(sql); }

 private:
  std::string data() const { return (dir_.path() / "data").string(); }

  pid_t start(std::vector<std::string> words) const {
    const std::string program = std::string(k_programs) + "/" + words.front();
    const std::string log = (dir_.path() / "log").string();
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const pid_t child = ::fork();
    if (child != 0) return child;
    if (uid_ != 0 && (::setgid(gid_) != 0 || ::setuid(uid_) != 0)) ::_exit(126);
    ::prctl(PR_SET_PDEATHSIG, SIGINT);
    const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(out, STDERR_FILENO);
    if (::chdir("/") == 0) ::execv(program.c_str(), arguments.data());
    ::_exit(127);
  }
  static int wait_for(pid_t child) {
    int status = 0;
    if (child <= 0 || ::waitpid(child, &status, 0) != child) return -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  ScratchDir dir_;
  uid_t uid_{0};
  gid_t gid_{0};
  pid_t pid_{-1};
};

/// The one that the tests of a process share, each with databases of its own.
inline PostgresServer& postgres_server() {
  static PostgresServer server;
  return server;
}

}  // namespace anchord
