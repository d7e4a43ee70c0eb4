#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <stop_token>
#include <vector>

#include "api/calibration/calibration_work.hpp"
#include "api/heavy_work.hpp"
#include "api/places/plan_work.hpp"
#include "core/base/errc_words.hpp"
#include "core/base/guard.hpp"
#include "core/base/to_wire.hpp"
#include "server/runtime/child_program.hpp"
#include "server/runtime/file_sandbox.hpp"
#include "server/runtime/frames.hpp"
#include "server/runtime/worker_process.hpp"

namespace anchord::server {
namespace {

using Json = nlohmann::json;

constexpr int k_socket = STDIN_FILENO;

void limit(__rlimit_resource what, rlim_t most) {
  rlimit now{};
  getrlimit(what, &now);
  now.rlim_cur = now.rlim_max = std::min(most, now.rlim_max);
  setrlimit(what, &now);
}

/// By SIGXCPU, which names its reason, and a moment later by the SIGKILL of the hard limit.
void limit_cpu(int seconds) {
  constexpr rlim_t k_grace_s = 5;
  rlimit now{};
  getrlimit(RLIMIT_CPU, &now);
  now.rlim_max = std::min(static_cast<rlim_t>(seconds) + k_grace_s, now.rlim_max);
  now.rlim_cur = std::min(static_cast<rlim_t>(seconds), now.rlim_max);
  setrlimit(RLIMIT_CPU, &now);
}

/// New sockets and programs are refused from here on: a model file that breaks the trainer gets no further.
/// `programs` are allowed where the work is to run one, which then has no sockets either.
void close_the_doors(bool programs) {
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  const auto refuse = [](unsigned number) {
    return std::array{sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, number, 0, 1),
                      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM)};
  };
  std::vector<sock_filter> program{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
  std::vector<unsigned> refused{SYS_socket, SYS_connect, SYS_bind, SYS_ptrace};
  if (!programs) refused.insert(refused.end(), {SYS_execve, SYS_execveat});
  for (const unsigned number : refused) {
    for (const auto& step : refuse(number)) program.push_back(step);
  }
  program.push_back(sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  // A kernel without the feature runs the work all the same: it is a second fence, not the first.
  prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter, 0, 0);
}

void settle_in(pid_t server) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != server) _exit(1);  // it died before the line above
  prctl(PR_SET_NAME, "anchord-worker");
  setpriority(PRIO_PROCESS, 0, 10);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_FSIZE, 0);
  limit(RLIMIT_NOFILE, 64);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadow counts as data
  limit(RLIMIT_DATA, rlim_t{4} << 30);
#endif
  limit_cpu(24 * 3600);
}

/// Once it is known what the work is, and before any of it is looked at.
void settle_for(const std::string& message) {
  const bool page = api::is_page_work(message);
  if (api::is_plan_work(message)) see_system_files_only();
  if (api::is_plan_work(message)) limit_cpu(api::plan_work_cpu_s(message));
  close_the_doors(page);
}

/// What to do about it where the memory did not suffice.
std::string too_little_memory(const std::string& allowed, bool plan, bool calibration) {
  const std::string than = " needs more memory than the " + allowed + " a worker may use: ";
  if (plan) return "the picture" + than + "scale it down";
  if (calibration) return "the calibration" + than + "calibrate fewer flights at once";
  return "the training" + than +
         "use a data set of means or medians, fewer rows, features or trees, and start the run again";
}

std::string allowed_memory() {
  rlimit now{};
  getrlimit(RLIMIT_DATA, &now);
  return now.rlim_cur == RLIM_INFINITY ? "memory of the machine"
                                       : std::to_string(now.rlim_cur >> 20) + " MiB of memory";
}

}  // namespace

int worker_main() {
  const pid_t server = getppid();
  settle_in(server);
  std::string message;
  FrameReader from_server(k_socket);
  if (from_server.read(message, -1) != FrameRead::frame) {
    std::fputs("anchord worker: without --database this is the process that a server starts by itself\n",
               stderr);
    return 2;
  }
  settle_for(message);
  std::stop_source stop;
  std::mutex writing;
  const auto send = [&writing](const Json& json, const std::string* behind = nullptr) {
    const std::scoped_lock lock(writing);
    if (!write_frame(k_socket, to_wire(json))) _exit(1);
    if (behind != nullptr && !write_frame(k_socket, *behind)) _exit(1);
  };
  // Hears the server while the work goes on: a word to stop, or its end.
  Thread listener("listener", [&stop, &from_server] {
    std::string text;
    while (true) {
      const auto read = from_server.read(text, -1);
      if (read == FrameRead::closed) _exit(1);
      if (read == FrameRead::frame) stop.request_stop();
    }
  });
  listener.detach();
  Result<std::string> result = make_error(Errc::internal, "");
  const auto told = [&send](const api::WorkProgress& p) {
    send({{"op", "progress"},
          {"stage", p.stage},
          {"stage_index", p.stage_index},
          {"stage_count", p.stage_count},
          {"fraction", p.fraction},
          {"detail", p.detail}});
  };
  const bool plan = api::is_plan_work(message), calibration = api::is_calibration_work(message);
  const auto programs = [cpu_s = plan ? api::plan_work_cpu_s(message) : 0](
                            const std::vector<std::string>& command, std::string_view input,
                            std::size_t max_output) {
    return run_program(command, input, max_output, cpu_s);
  };
  // The door of jobs, in this process.
  const auto ran = guarded(plan          ? "floor plan"
                           : calibration ? "calibration"
                                         : "training",
                           [&] {
                             try {
                               result = plan ? api::do_plan_work(message, stop.get_token(), told, programs)
                                             : api::do_work(message, stop.get_token(), told);
                             } catch (const std::bad_alloc&) {
                               message.clear();
                               message.shrink_to_fit();  // room for the answer
                               result = make_error(plan ? Errc::invalid_argument : Errc::unsupported,
                                                   too_little_memory(allowed_memory(), plan, calibration));
                             }
                           });
  if (!ran) {
    result = make_error(Errc::link_lost,
                        "the worker process failed: " + ran.what +
                            (plan || calibration ? "" : "; the run, its data and settings are kept"));
  }
  if (result)
    send({{"op", "done"}}, &result.value());  // as it is: pictures are no text
  else
    send({{"op", "failed"},
          {"code", k_errc_words.word(result.error().code)},
          {"message", result.error().message}});
  std::fflush(stderr);
  _exit(0);  // the listener still waits: nothing else is left to clean
}

}  // namespace anchord::server
