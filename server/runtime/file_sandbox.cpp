#include "server/runtime/file_sandbox.hpp"

#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <initializer_list>

namespace anchord::server {
namespace {

/// Every right of the first version of Landlock (Linux 5.13): what is not allowed below is refused.
constexpr __u64 k_all = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1) - 1;
constexpr __u64 k_read =
    LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr __u64 k_read_file = LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_READ_FILE;

void allow(int rules, const char* path, __u64 rights) {
  const int fd = ::open(path, O_PATH | O_CLOEXEC);
  if (fd < 0) return;
  const landlock_path_beneath_attr rule{rights, fd};
  (void)::syscall(SYS_landlock_add_rule, rules, LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
  ::close(fd);
}

}  // namespace

void see_system_files_only() {
  landlock_ruleset_attr all{};
  all.handled_access_fs = k_all;
  const auto rules =
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &all, sizeof all.handled_access_fs, 0));
  if (rules < 0) return;
  for (const char* folder :
       {"/usr", "/lib", "/lib64", "/etc/fonts", "/etc/alternatives", "/var/cache/fontconfig"})
    allow(rules, folder, k_read);
  for (const char* file : {"/etc/ld.so.cache", "/dev/null", "/dev/urandom"}) allow(rules, file, k_read_file);
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  (void)::syscall(SYS_landlock_restrict_self, rules, 0);
  ::close(rules);
}

}  // namespace anchord::server
