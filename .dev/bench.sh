# Speeds and hostile input. Both build into folders of their own and leave build/release as it was.

# cmd_bench [NAME...]: tables on stdout; see tests/bench/README.md.
cmd_bench() {
  install_packages test bench
  ensure_node
  ensure_test_packages
  if [[ ${1:-} == soak || ${1:-} == exports || ${1:-} == calibrate || ${1:-} == cluster ]]; then
    local what=$1
    shift
    build_preset release anchord
    ANCHORD_BINARY=$PWD/$build_dir/anchord node "tests/bench/$what.mjs" "$@" || die "$what found something: see its table above"
    return
  fi
  build_preset bench
  ANCHORD_BINARY=$PWD/build/bench/anchord ANCHORD_BENCH_DIR=$PWD/build/bench node tests/bench/bench.mjs "$@"
}

# cmd_fuzz [SECONDS [TARGET...]]: each target for so long; a crash is kept and named, and the exit code tells.
cmd_fuzz() {
  install_packages fuzz
  local seconds=${1:-60} target name status=0 crashes=()
  [[ $seconds =~ ^[0-9]+$ ]] || die "fuzz [SECONDS [TARGET...]]: '$seconds' is not a number of seconds"
  (($# > 0)) && shift
  build_preset fuzz anchord_fuzzers
  for target in build/fuzz/fuzz/fuzz_*; do
    name=${target##*/fuzz_}
    (($# > 0)) && [[ " $* " != *" $name "* ]] && continue
    say "fuzzing $name for $seconds s"
    mkdir -p "build/fuzz/corpus/$name" "tests/fuzz/corpus/$name"
    "$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 -verbosity=0 \
      -artifact_prefix="build/fuzz/crash-$name-" "build/fuzz/corpus/$name" "tests/fuzz/corpus/$name" \
      2>"build/fuzz/$name.log" || { status=1; crashes+=("$name"); tail -n 40 "build/fuzz/$name.log"; }
    awk '/stat::number_of_executed_units/ {n = $2} /stat::average_exec_per_sec/ {r = $2} END {printf "    %d inputs, %d a second\n", n, r}' "build/fuzz/$name.log"
  done
  ((status == 0)) || die "crashes in: ${crashes[*]} (inputs: build/fuzz/crash-*)"
  say "fuzzing found nothing"
}
