# cmd_test [ctest arguments...]: everything through CTest, one honest summary line at the end.
cmd_test() {
  install_packages test ${ANCHORD_FRESH_ROOT:+fresh}
  ensure_node
  build_preset release
  local log=$build_dir/test.log junit=$build_dir/junit.xml status=0 jobs
  jobs=$(jobs_count)
  rm -f "$junit"
  say "testing"
  ctest --test-dir "$build_dir" --output-on-failure --no-tests=error -j "$jobs" \
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
