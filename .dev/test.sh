# cmd_test [--arm64 | --asan | --tsan] [ctest arguments...]: everything through CTest, one honest summary line at the end.
cmd_test() {
  case ${1:-} in
    --arm64) arm64_tests ; return ;;
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
  rerun=no run_tests "build/$preset" -LE "$left_out_labels" -E "$left_out_names" "$@"
}

# run_tests FOLDER [ctest arguments...]: of what is built there; ${fixed[@]} of the caller goes before ctest. With rerun=no a failure stands
# at once: what a sanitizer finds is found, however seldom.
run_tests() {
  local folder=$1 ; shift
  local log=$folder/test.log junit=$folder/junit.xml second=$folder/junit-alone.xml status=0 jobs alone
  jobs=$(jobs_count)
  ((jobs *= 4))  # a test that computes takes four (tests/CMakeLists.txt); the others wait, for aircraft, pages and leases that live in real time
  rm -f "$junit" "$second"
  say "testing"
  ${fixed[@]+"${fixed[@]}"} ctest --test-dir "$folder" --output-on-failure --no-tests=error -j "$jobs" \
    --output-junit "$PWD/$junit" "$@" 2>&1 | tee "$log" || status=$?
  [[ -s $junit ]] || die "ctest wrote no results (exit code $status): see $log"
  alone=$(to_run_alone "$junit")
  if [[ -n $alone && ${rerun:-yes} == yes ]]; then
    say "again, each alone: $alone"
    ctest --test-dir "$folder" --output-on-failure -j 1 --output-junit "$PWD/$second" -R "^($alone)\$" 2>&1 | tee -a "$log" || status=$?
    [[ -s $second ]] || die "ctest wrote no results of the tests run alone: see $log"
    status=0  # the two files tell all there is to tell
  fi
  summarize "$junit" "$second" || status=1
  # The summary is the sentence.
  ((status == 0)) || exit 1
}

# Of CTest's own JUnit file, case by case, a line "passed NAME", "skipped NAME" or "failed NAME": what neither ran well nor
# was skipped by its own word has failed, a test whose executable is missing included.
verdicts() {
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
      if (state == "run") print "passed", name
      else if (state == "notrun" && message ~ /^SKIP_/) print "skipped", name
      else if (state == "disabled") print "skipped", name " (disabled)"
      else print "failed", name
    }
    END { close_case() }' "$1"
}

# to_run_alone JUNIT: names as a regular expression. Tests work in real time with ports, disks, a browser, an aircraft, beside another test
# on the other core: one to three that failed are run once more, alone. More than three stand.
to_run_alone() {
  verdicts "$1" | awk '
    $1 == "failed" { name = $2; gsub(/[^A-Za-z0-9_\/-]/, ".", name); names = names (failed++ ? "|" : "") name }
    END { if (failed >= 1 && failed <= 3) print names }'
}

# summarize JUNIT [JUNIT OF THOSE RUN ALONE]: names what did not just pass, then the counts. What passed only alone is named too: it is
# a defect of the test or of the product that nobody has found yet.
summarize() {
  local all alone=
  all=$(verdicts "$1")
  [[ ! -s ${2:-} ]] || alone=$(verdicts "$2")
  awk '
    FNR == NR { if ($1 == "passed") passed_alone[$2] = 1; next }
    $1 == "failed" && ($2 in passed_alone) { print "ALONE   " $2 ": failed beside another test, passed alone; its first output is above"; $1 = "passed" }
    { count[$1]++ }
    $1 == "skipped" { sub(/^skipped /, ""); print "SKIPPED " $0 }
    $1 == "failed" { failed_lines = failed_lines "FAILED  " $2 "\n" }
    END {
      printf "%s%d passed, %d failed, %d skipped\n", failed_lines, count["passed"], count["failed"], count["skipped"]
      exit count["failed"] > 0 || !count["passed"]
    }' <(printf '%s\n' "$alone") <(printf '%s\n' "$all")
}
