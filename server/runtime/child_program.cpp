#include "server/runtime/child_program.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "core/base/text.hpp"

namespace anchord::server {
namespace {

constexpr std::size_t k_most_complaint = 4096;

class Pipe {
 public:
  Pipe() {
    if (::pipe2(ends_.data(), O_CLOEXEC) != 0) ends_ = {-1, -1};
  }
  ~Pipe() {
    close(0);
    close(1);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  bool good() const { return ends_[0] >= 0; }
  /// 0: what is read, 1: what is written.
  int end(std::size_t which) const { return ends_[which]; }
  void close(std::size_t which) {
    if (ends_[which] >= 0) ::close(ends_[which]);
    ends_[which] = -1;
  }

 private:
  std::array<int, 2> ends_{};
};

/// In the new process, where only what is safe after a fork may be called.
[[noreturn]] void become(char* const* arguments, const char* path, const Pipe& in, const Pipe& out,
                         const Pipe& complaints, const rlimit& cpu) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::setrlimit(RLIMIT_CPU, &cpu);
  ::signal(SIGPIPE, SIG_DFL);
  ::signal(SIGXFSZ, SIG_IGN);  // it may write no file: an error for it, not its end
  ::dup2(in.end(0), STDIN_FILENO);
  ::dup2(out.end(1), STDOUT_FILENO);
  ::dup2(complaints.end(1), STDERR_FILENO);
  char* const none[] = {nullptr};
  ::execve(path, arguments, none);
  _exit(127);
}

/// What is left of cpu_s after the programs before. SIGXCPU says which limit it was: SIGKILL has many
/// reasons.
rlimit cpu_left(int cpu_s) {
  rusage used{};
  ::getrusage(RUSAGE_CHILDREN, &used);
  const auto left = std::max<std::int64_t>(cpu_s - used.ru_utime.tv_sec - used.ru_stime.tv_sec, 1);
  rlimit now{};
  ::getrlimit(RLIMIT_CPU, &now);
  now.rlim_cur = std::min(static_cast<rlim_t>(left), now.rlim_max);
  return now;
}

/// Reads what there is; false at the end. What goes beyond `most` is counted and left out.
bool read_some(int fd, std::string& text, std::size_t most, bool& more) {
  std::array<char, 1 << 16> part;
  const auto n = ::read(fd, part.data(), part.size());
  if (n < 0) return errno == EINTR || errno == EAGAIN;
  const auto taken = std::min(static_cast<std::size_t>(n), most - std::min(most, text.size()));
  text.append(part.data(), taken);
  more = more || taken < static_cast<std::size_t>(n);
  return n > 0;
}

struct Said {
  std::string out, complaint;
  bool more{false};  ///< than was allowed
};

/// Until it has closed both of its ends, or printed too much.
Said converse(Pipe& in, Pipe& out, Pipe& complaints, std::string_view input, std::size_t max_output) {
  Said said;
  bool ignored = false;
  ::fcntl(in.end(1), F_SETFL, O_NONBLOCK);
  while ((out.end(0) >= 0 || complaints.end(0) >= 0) && !said.more) {
    if (input.empty()) in.close(1);
    std::array<pollfd, 3> on{
        {{in.end(1), POLLOUT, 0}, {out.end(0), POLLIN, 0}, {complaints.end(0), POLLIN, 0}}};
    if (::poll(on.data(), on.size(), -1) < 0 && errno != EINTR) break;
    if (on[0].revents != 0) {
      const auto n = ::write(in.end(1), input.data(), input.size());
      if (n > 0)
        input.remove_prefix(static_cast<std::size_t>(n));
      else if (n < 0 && errno != EAGAIN && errno != EINTR)
        in.close(1);  // it wants no more
    }
    if (on[1].revents != 0 && !read_some(out.end(0), said.out, max_output, said.more)) out.close(0);
    if (on[2].revents != 0 && !read_some(complaints.end(0), said.complaint, k_most_complaint, ignored))
      complaints.close(0);
  }
  return said;
}

/// What a program complained of last, which most often is what ended it.
std::string last_line(std::string_view text) {
  while (text.ends_with('\n')) text.remove_suffix(1);
  const auto begin = text.rfind('\n');
  return to_utf8(begin == std::string_view::npos ? text : text.substr(begin + 1), 200);
}

}  // namespace

Result<std::string> run_program(const std::vector<std::string>& command, std::string_view input,
                                std::size_t max_output, int cpu_s) {
  const std::string path = "/usr/bin/" + command.at(0);
  if (::access(path.c_str(), X_OK) != 0)
    return make_error(Errc::unsupported, command[0] + " is not installed on the server");
  std::vector<std::string> words = command;
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  Pipe in, out, complaints;
  if (!in.good() || !out.good() || !complaints.good())
    return make_error(Errc::internal, std::string("cannot make a pipe: ") + std::strerror(errno));
  const auto before = ::signal(SIGPIPE, SIG_IGN);
  const rlimit cpu = cpu_left(cpu_s);
  const pid_t pid = ::fork();
  if (pid == 0) become(arguments.data(), path.c_str(), in, out, complaints, cpu);
  in.close(0);
  out.close(1);
  complaints.close(1);
  if (pid < 0) {
    ::signal(SIGPIPE, before);
    return make_error(Errc::internal, "cannot start " + path + ": " + std::strerror(errno));
  }
  const Said said = converse(in, out, complaints, input, max_output);
  if (said.more) ::kill(pid, SIGKILL);
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  ::signal(SIGPIPE, before);
  if (said.more)
    return make_error(Errc::invalid_argument,
                      command[0] + " produced more than " + std::to_string(max_output >> 20) + " MiB");
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)
    return make_error(Errc::no_convergence,
                      command[0] + " used up " + std::to_string(cpu_s) + " s of processor time");
  if (status != 0)
    return make_error(Errc::bad_frame,
                      command[0] + " failed (" +
                          (said.complaint.empty() ? "the file is too large for its memory, or broken"
                                                  : last_line(said.complaint)) +
                          ')');
  return said.out;
}

}  // namespace anchord::server
