# Shared by every command of ./dev: messages, paths, how many jobs. Sourced, never run.
# Working directory is the project root; nothing here depends on its name, so that spaces in it are harmless.

build_dir=build/release

say() { if [[ -t 2 ]]; then printf "\033[1m==> %s\033[0m\n" "$*"; else printf "==> %s\n" "$*"; fi >&2; }
# One line says what is wrong; the caller's exit code is 1.
die() { printf 'dev: %s\n' "$*" >&2; exit 1; }

# One compiler job per core, but no more than the memory carries: a translation unit with Beast takes about 1.2 GB.
jobs_count() {
  local cores memory_jobs
  cores=$(nproc)
  memory_jobs=$(awk '/MemAvailable/ {print int($2 / 1500000)}' /proc/meminfo)
  ((memory_jobs >= 1)) || memory_jobs=1
  echo $((cores < memory_jobs ? cores : memory_jobs))
}

# Numbers of a version as one comparable integer: 20.19.3 -> 20019003.
version_number() {
  local IFS=. ; local -a part
  read -r -a part <<<"${1#v}"
  echo $((10#${part[0]:-0} * 1000000 + 10#${part[1]:-0} * 1000 + 10#${part[2]:-0}))
}
