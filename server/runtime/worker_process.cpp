#include "server/runtime/worker_process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "api/calibration/calibration_work.hpp"
#include "api/places/plan_work.hpp"
#include "core/base/errc_words.hpp"
#include "core/base/text.hpp"
#include "server/runtime/frames.hpp"
#include "server/runtime/start_program.hpp"

extern char** environ;

namespace anchord::server {
namespace {

using Json = nlohmann::json;
using Steady = std::chrono::steady_clock;

constexpr auto k_grace = std::chrono::milliseconds(500);

class Socket {
 public:
  explicit Socket(int fd) : fd_(fd) {}
  ~Socket() { close(); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int fd() const { return fd_; }
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

 private:
  int fd_;
};

/// What most often lies behind a worker's death, and what helps.
std::string cause_of(int signal, const std::string& message) {
  if (api::is_plan_work(message)) return "a fault of the decoder or too little memory";
  const bool calibration = api::is_calibration_work(message);
  switch (signal) {
    case SIGKILL:
      return std::string("usually because the machine had no memory left; free some memory, or ") +
             (calibration ? "calibrate fewer flights at once"
                          : "train on fewer rows or a smaller grid, and start the run again");
    case SIGXCPU:
      return std::string("it had used its 24 hours of processor time; ") +
             (calibration ? "calibrate fewer flights at once" : "train on fewer rows or a smaller grid");
    default:
      return calibration
                 ? "a fault of the solver or too little memory; the flights are kept: report the fault"
                 : "a fault of the trainer or too little memory; the run, its data and settings are kept: "
                   "try fewer rows or another method, and report the fault";
  }
}

/// A child that is always collected: killed where it still runs when this goes.
class Child {
 public:
  /// message  outlives it
  Child(pid_t pid, const std::string& message) : pid_(pid), message_(message) {}
  ~Child() {
    if (pid_ <= 0) return;
    kill();
    (void)end();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  void kill() const { ::kill(pid_, SIGKILL); }
  /// Waits for its end; the error that it is for the work.
  Error end(const char* when = "") {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = 0;
    if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU && api::is_plan_work(message_))
      return api::too_busy(api::plan_work_cpu_s(message_));
    if (WIFSIGNALED(status))
      return make_error(Errc::link_lost, "the worker process was ended by signal " +
                                             std::to_string(WTERMSIG(status)) + " (" +
                                             strsignal(WTERMSIG(status)) +
                                             "): " + cause_of(WTERMSIG(status), message_) + when);
    return make_error(Errc::link_lost, "the worker process ended with code " +
                                           std::to_string(WEXITSTATUS(status)) + " without an answer" + when);
  }

 private:
  pid_t pid_;
  const std::string& message_;
};

Result<pid_t> spawn(const std::filesystem::path& program, int socket) {
  ProgramStart start{.program = program, .arguments = {"anchord", "worker"}, .environment = {}};
  // Settings of the server may be secrets, and are none of the worker's business.
  for (char** one = environ; *one != nullptr; ++one)
    if (std::strncmp(*one, "ANCHORD_", 8) != 0) start.environment.emplace_back(*one);
  start.input = socket;
  start.keep_stderr = true;
  return start_program(start);
}

/// Absent where one of its fields is not what it should be.
std::optional<api::WorkProgress> progress_of(const Json& j) {
  const auto text = [&](const char* key) { return j.contains(key) && j[key].is_string(); };
  const auto count = [&](const char* key) { return j.contains(key) && j[key].is_number_unsigned(); };
  if (!text("stage") || !text("detail") || !count("stage_index") || !count("stage_count") ||
      !j.contains("fraction") || !j["fraction"].is_number())
    return std::nullopt;
  return api::WorkProgress{j["stage"].get<std::string>(), j["stage_index"].get<std::size_t>(),
                           j["stage_count"].get<std::size_t>(), j["fraction"].get<double>(),
                           j["detail"].get<std::string>()};
}

Error unreadable(const std::string& what) {
  return make_error(Errc::internal, "the message of the worker process cannot be read: " + what);
}

/// A word that this version does not know is an error of its own: what it meant is not guessed.
Error failure_of(std::string_view code, std::string message) {
  const auto known = k_errc_words.parse("code", code);
  if (!known) return unreadable(known.error().message + "; its text is: " + message);
  return make_error(known.value(), std::move(message));
}

Result<std::string> run(const std::filesystem::path& program, const std::string& message,
                        const api::WorkProgressSink& progress, const std::function<bool()>& canceled) {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    return make_error(Errc::internal, std::string("cannot start a worker process: ") + std::strerror(errno));
  Socket ours(ends[0]), theirs(ends[1]);
  BOOST_OUTCOME_TRY(const auto pid, spawn(program, theirs.fd()));
  Child child(pid, message);
  theirs.close();
  FrameReader answers(ours.fd());
  bool gave_up = false;
  if (!write_frame(ours.fd(), message, [&] { return gave_up = canceled(); })) {
    if (gave_up) return make_error(Errc::canceled, "canceled");
    return child.end(" before it began");
  }
  std::optional<Steady::time_point> asked_to_stop;
  std::string text;
  bool done = false;  // the next frame is the result
  while (true) {
    if (!asked_to_stop && canceled()) {
      asked_to_stop = Steady::now();
      (void)write_frame(ours.fd(), R"({"op":"cancel"})", [] { return true; });  // who takes nothing is killed
    }
    if (asked_to_stop && Steady::now() - *asked_to_stop > k_grace) {
      child.kill();
      return make_error(Errc::canceled, "canceled");
    }
    switch (answers.read(text, 50)) {
      case FrameRead::nothing:
        continue;
      case FrameRead::closed:
        if (asked_to_stop) return make_error(Errc::canceled, "canceled");
        return child.end();
      case FrameRead::frame:
        break;
    }
    if (done) return text;
    // It may be anything: the worker ran on data from outside.
    auto json = Json::parse(text, nullptr, false);
    const auto word = [&](const char* key) {
      const auto at = json.is_object() ? json.find(key) : json.end();
      return at != json.end() && at->is_string() ? at->get<std::string>() : std::string();
    };
    const std::string op = word("op");
    if (op == "progress") {
      const auto told = progress_of(json);
      if (!told) return unreadable("progress without stage, stage_index, stage_count, fraction, detail");
      if (progress) progress(*told);
    } else if (op == "done") {
      done = true;
    } else if (op == "failed") {
      return failure_of(word("code"), word("message"));
    } else {
      return unreadable("op \"" + to_utf8(op, 60) + "\" is none of progress, done, failed");
    }
  }
}

}  // namespace

api::RunWork work_in_process(std::filesystem::path program) {
  return [program = std::move(program)](const std::string& message, const api::WorkProgressSink& progress,
                                        const std::function<bool()>& canceled) {
    return run(program, message, progress, canceled);
  };
}

}  // namespace anchord::server
