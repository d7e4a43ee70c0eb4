# Shared by the tests of this folder: checks that count, and the verdict at the end. Sourced, never run.
failures=0
checks=0

pass_or_fail() {   # pass_or_fail 0|1 WHAT [DETAIL]
  checks=$((checks + 1))
  if (($1 == 0)); then return; fi
  failures=$((failures + 1))
  printf 'FAILED: %s\n' "$2"
  [[ -z ${3:-} ]] || printf '%s\n' "$3" | sed 's/^/    | /'
}

# expect WHAT STATUS PATTERN: of the last `attempt`: its exit code ("fails" is any but 0), and a line of its output.
expect() {
  local wrong=0
  if [[ $2 == fails ]]; then ((status != 0)) || wrong=1; else ((status == $2)) || wrong=1; fi
  [[ $output =~ $3 ]] || wrong=1
  pass_or_fail "$wrong" "$1: wanted exit code $2 and /$3/, got exit code $status and" "$output"
}
attempt() { output=$("$@" 2>&1) && status=0 || status=$?; }

verdict() {
  printf '%d checks, %d failed\n' "$checks" "$failures"
  ((failures == 0))
}
