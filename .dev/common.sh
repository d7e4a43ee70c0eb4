# Shared by every command of ./dev: messages, paths, how many jobs. Sourced, never run.
# Working directory is the project root; nothing here depends on its name, so that spaces in it are harmless.

build_dir=build/release

say() { if [[ -t 2 ]]; then printf "\033[1m==> %s\033[0m\n" "$*"; else printf "==> %s\n" "$*"; fi >&2; }

# Exit code of a subshell whose failure has been reported: its parent ends too, without a second sentence.
reported=199
end_with() { if ((BASH_SUBSHELL > 0)); then exit "$reported"; else exit "$1"; fi; }

# One line says what is wrong; the caller's exit code is 1.
die() { printf 'dev: %s\n' "$*" >&2; end_with 1; }

# Nothing of ./dev ends without a sentence. What a script expects to fail stands in `if`, `||` or `&&`; all else comes here,
# from functions, pipelines and command substitutions too (set -E, inherit_errexit). Two forms bash hides from this trap are
# forbidden in the scripts: `local x=$(command)` and `< <(command)`; tests/dev/sentences.test.sh refuses them.
report_failure() {
  local status=$1 command=$2 file=$3 line=$4 text
  trap - ERR
  if ((status != reported)); then
    text=$(sed -n "${line}{s/^ *//;p}" "$file" 2>/dev/null) || text=
    printf 'dev: %s, line %s: exit code %s from: %s\n' "$file" "$line" "$status" "${text:-$command}" >&2
    [[ -z $text || $text == *"$command"* ]] || printf 'dev: the last command of it was: %s\n' "$command" >&2
  fi
  end_with "$((status == reported ? 1 : status))"
}
trap 'report_failure $? "$BASH_COMMAND" "${BASH_SOURCE[0]}" "$LINENO"' ERR

# What every command needs, said before the first of them fails half-way.
check_machine() {
  local tool ; local -a absent=()
  for tool in awk cut dirname env grep mkdir paste sed seq sha256sum sleep tail tee tr uname wc xargs; do
    command -v "$tool" >/dev/null || absent+=("$tool")
  done
  ((${#absent[@]} == 0)) || die "this machine has no ${absent[*]}: install Debian's coreutils, findutils, grep, mawk and sed"
  mkdir -p build 2>/dev/null && [[ -w . && -w build ]] ||
    die "$PWD or its folder build is not writable for user $(id -un 2>/dev/null || echo "$EUID"): everything made here goes there"
  # C.UTF-8 is part of Debian's libc: contracts are read as UTF-8 and numbers have points whatever the user's language is.
  export LC_ALL=C.UTF-8
  # npm and ccache keep things at home; a service's environment has none, or one of somebody else.
  [[ -n ${HOME:-} ]] || HOME=~
  [[ -d $HOME && -w $HOME ]] || HOME=$PWD/build/home
  export HOME
  mkdir -p "$HOME"
}

# One compiler job per core, but no more than the memory carries: a translation unit with Beast takes up to 1.8 GB.
# Where the machine does not tell (no /proc in a chroot), one job.
jobs_count() {
  local cores memory_jobs
  cores=$(nproc 2>/dev/null) || cores=1
  memory_jobs=$(awk '/MemAvailable/ {print int($2 / 1800000)}' /proc/meminfo 2>/dev/null) || memory_jobs=1
  ((memory_jobs >= 1)) || memory_jobs=1
  echo $((cores < memory_jobs ? cores : memory_jobs))
}

# Numbers of a version as one comparable integer: 20.19.3 -> 20019003.
version_number() {
  local IFS=. ; local -a part
  read -r -a part <<<"${1#v}"
  echo $((10#${part[0]:-0} * 1000000 + 10#${part[1]:-0} * 1000 + 10#${part[2]:-0}))
}

# Packages of the tests written in JavaScript.
ensure_test_packages() {
  [[ -d tests/node_modules ]] && return
  say "installing the packages of the end-to-end tests"
  (cd tests && npm ci --loglevel=error) || die "npm ci in tests/ failed: see its own message above (is the npm registry reachable?)"
}
