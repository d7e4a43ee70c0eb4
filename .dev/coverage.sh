# cmd_coverage [ctest arguments...]: the C++ tests in a build of their own that counts lines, then one table: lines by folder.
cmd_coverage() {
  install_packages test coverage
  ensure_node
  build_preset coverage
  find build/coverage -name '*.gcda' -delete
  say "left out: the dashboard, and tests with the labels e2e, dev and lint (other programs, scripts)"
  # A line counts whether its test passed or not; the exit code tells of both.
  local status=0
  (run_tests build/coverage -LE "$left_out_labels" -E "$left_out_names" "$@") || status=$?
  say "counting lines"
  gcovr --root . --object-directory build/coverage --csv build/coverage/coverage.csv \
    --filter 'core/' --filter 'drivers/' --filter 'api/' --filter 'server/' --filter 'migrations/' build/coverage ||
    die "gcovr failed: see its own message above"
  coverage_table build/coverage/coverage.csv || die "build/coverage/coverage.csv has no line: did any test run?"
  ((status == 0)) || die "some tests failed: what they did not reach is not counted"
}

# Of gcovr's rows (file, lines, lines reached, ...): a row for each top folder and for each folder in it.
coverage_table() {
  awk -F, '
    NR > 1 {
      n = split($1, part, "/")
      top = part[1]; inner = n > 2 ? top "/" part[2] : top "/."
      lines[top] += $2; reached[top] += $3; lines[inner] += $2; reached[inner] += $3
      lines["all"] += $2; reached["all"] += $3
    }
    END {
      if (!lines["all"]) exit 1
      printf "%-28s %8s %8s %7s\n", "folder", "lines", "reached", "%"
      for (name in lines) if (name != "all") {
        row = sprintf("%-28s %8d %8d %7.1f", name, lines[name], reached[name], 100 * reached[name] / lines[name])
        print row | "sort"
      }
      close("sort")
      printf "%-28s %8d %8d %7.1f\n", "all", lines["all"], reached["all"], 100 * reached["all"] / lines["all"]
    }' "$1"
}
