# cmd_test [--asan | --tsan] [ctest arguments...]: everything through CTest, one honest summary line at the end.
cmd_test() {
  case ${1:-} in
    --asan | --tsan) sanitized_tests "$@" ; return ;;
    --*san) die "test knows --asan (addresses, undefined behaviour) and --tsan (threads); not '$1'" ;;
  esac
  install_packages test ${ANCHORD_FRESH_ROOT:+fresh}
  ensure_node
  build_preset release
  run_tests "$build_dir" "$@"
}

# What a sanitizer's run leaves out, by label and by name: other programs, the scripts, and limits in wall-clock time.
left_out_labels='^(e2e|dev|lint)$'
left_out_names='Within[0-9]+Milliseconds|Quickly$'

# sanitized_tests --asan|--tsan [ctest arguments...]: the C++ tests in a build of their own; what is found ends its test.
sanitized_tests() {
  local preset=${1#--} ; shift
  local -a fixed=()
  install_packages test
  ensure_node
  build_preset "$preset"
  say "left out under $preset: the dashboard and its tests, tests with the labels e2e, dev and lint (other programs, scripts), and limits in milliseconds"
  export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
  export TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1
  # The thread sanitizer of g++ 12 ends at once where the kernel spreads addresses wider than it knows.
  if [[ $preset == tsan ]] && setarch "$(uname -m)" -R true 2>/dev/null; then fixed=(setarch "$(uname -m)" -R); fi
  run_tests "build/$preset" -LE "$left_out_labels" -E "$left_out_names" "$@"
}

# run_tests FOLDER [ctest arguments...]: of what is built there; ${fixed[@]} of the caller goes before ctest.
run_tests() {
  local folder=$1 ; shift
  local log=$folder/test.log junit=$folder/junit.xml status=0 jobs
  jobs=$(jobs_count)
  rm -f "$junit"
  say "testing"
  ${fixed[@]+"${fixed[@]}"} ctest --test-dir "$folder" --output-on-failure --no-tests=error -j "$jobs" \
    --output-junit "$PWD/$junit" "$@" 2>&1 | tee "$log" || status=$?
  [[ -s $junit ]] || die "ctest wrote no results (exit code $status): see $log"
  summarize "$junit" || status=1
  # The summary is the sentence.
  ((status == 0)) || exit 1
}

# Counts from CTest's own JUnit file, case by case: what neither ran well nor was skipped by its own word has failed,
# a test whose executable is missing included.
summarize() {
  awk '
    function attribute(line, name,   at) {
      if (!match(line, " " name "=\"[^\"]*\"")) return ""
      at = RSTART + length(name) + 3
      return substr(line, at, RSTART + RLENGTH - at - 1)
    }
    /<testcase / { close_case(); name = attribute($0, "name"); state = attribute($0, "status"); message = ""; open = 1 }
    /<skipped/ { if (open) message = attribute($0, "message") }
    function close_case() {
      if (!open) return
      open = 0
      if (state == "run") passed++
      else if (state == "notrun" && message ~ /^SKIP_/) skipped_names[++skipped] = name
      else if (state == "disabled") skipped_names[++skipped] = name " (disabled)"
      else failed_names[++failed] = name
    }
    END {
      close_case()
      for (i = 1; i <= skipped; i++) print "SKIPPED " skipped_names[i]
      for (i = 1; i <= failed; i++) print "FAILED  " failed_names[i]
      printf "%d passed, %d failed, %d skipped\n", passed, failed, skipped
      exit failed > 0 || passed == 0
    }' "$1"
}
