#!/usr/bin/env bash
# ./dev test --asan, --tsan and ./dev coverage: which build they make, what they run, what they say they leave out.
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
source "$root/tests/dev/checks.sh"
scratch=$(mktemp -d "${TMPDIR:-/tmp}/anchord dev XXXXXX")
trap 'rm -rf "$scratch"' EXIT

# A copy of the scripts, and stand-ins for the programs they call: each writes down how it was called.
mkdir -p "$scratch/checkout" "$scratch/bin"
cp -R "$root/dev" "$root/.dev" "$root/.ci" "$scratch/checkout/"
stand_in() {   # stand_in NAME BODY
  printf '#!/bin/bash\necho "%s $*" >>"%s"\n%s\n' "$1" "$scratch/calls" "$2" >"$scratch/bin/$1"
  chmod +x "$scratch/bin/$1"
}
stand_in dpkg-query 'echo installed'
stand_in apt-get 'exit 1'
stand_in node 'echo v22.12.0'
stand_in npm ''
stand_in cmake 'mkdir -p "build/$2"'
stand_in ninja ''
stand_in setarch '[[ $2 == -R ]] && shift 2 && exec "$@"'
stand_in ctest '
says=${CTEST_SAYS:-run}
while (($#)); do
  [[ $1 == --output-junit ]] && junit=$2
  [[ $1$2 == -j1 ]] && says=${CTEST_SAYS_ALONE:-fail}
  shift
done
mkdir -p "${junit%/*}"
printf "<testcase name=\"%s\" status=\"%s\">\n</testcase>\n" "${CTEST_NAME:-One.Two}" "$says" >"$junit"
echo "options: ubsan=$UBSAN_OPTIONS tsan=$TSAN_OPTIONS"'
stand_in gcovr '
while (($#)); do [[ $1 == --csv ]] && csv=$2; shift; done
printf "filename,line_total,line_covered,line_percent\ncore/a.cpp,10,9,0.9\ncore/geo/b.cpp,30,15,0.5\napi/http/c.cpp,60,60,1.0\n" >"$csv"'
run() { : >"$scratch/calls"; attempt env PATH="$scratch/bin:$PATH" "$scratch/checkout/dev" "$@"; calls=$(cat "$scratch/calls"); }
called() { [[ $calls =~ $2 ]] ; pass_or_fail $? "$1: no call like /$2/ in" "$calls"; }

run test --asan -R Solver
expect "test --asan" 0 '1 passed, 0 failed, 0 skipped'
expect "test --asan says what it leaves out" 0 'left out under asan: .*labels e2e, dev and lint .*limits in milliseconds'
expect "what it finds ends its test" 0 'options: ubsan=halt_on_error=1'
called "test --asan" 'cmake --preset asan'
called "test --asan" 'ninja -C build/asan'
called "test --asan" 'ctest --test-dir build/asan .*-LE \^\(e2e\|dev\|lint\)\$ -E .*Milliseconds.* -R Solver'
[[ $calls != *"--preset release"* ]] ; pass_or_fail $? "test --asan leaves build/release alone" "$calls"

run test --tsan
expect "test --tsan" 0 'left out under tsan'
called "test --tsan" 'cmake --preset tsan'
called "test --tsan, without address randomization" 'setarch [a-z0-9_]+ -R ctest --test-dir build/tsan'

CTEST_SAYS=fail run test --tsan
expect "a test that fails under a sanitizer" 1 'FAILED  One\.Two'
run test --msan
expect "a sanitizer that is not there" 1 "dev: test knows --asan .* and --tsan .*; not '--msan'"
run package --armhf
expect "a machine that packages are not made for" 1 "dev: package knows --arm64 .*; not '--armhf'"

CTEST_SAYS=fail CTEST_SAYS_ALONE=run run test --tsan
expect "what a sanitizer found once is found" 1 'FAILED  One\.Two'
CTEST_SAYS=fail CTEST_SAYS_ALONE=run run test
expect "a test that passes alone" 0 'ALONE   One.Two: failed beside another test, passed alone.*1 passed, 0 failed'
called "a test that failed is run again" 'ctest .*-j 1 .*-R \^\(One.Two\)\$'
CTEST_SAYS=fail run test
expect "a test that fails alone too" 1 'FAILED  One\.Two'
[[ $output != *ALONE* ]] ; pass_or_fail $? "what fails twice did not pass alone" "$output"

run coverage
expect "coverage by folder" 0 'core +40 +24 +60\.0'
expect "coverage of an inner folder" 0 'core/geo +30 +15 +50\.0'
expect "coverage of all" 0 'all +100 +84 +84\.0'
called "coverage" 'cmake --preset coverage'
called "coverage" 'ctest --test-dir build/coverage .*-LE'
called "coverage" 'gcovr .*--csv build/coverage/coverage\.csv'
CTEST_SAYS=fail run coverage
expect "coverage with a failed test" 1 'dev: some tests failed'
expect "the table is printed all the same" 1 'api/http +60 +60 +100\.0'

run help
for word in 'test --asan|--tsan' 'coverage \[CTEST ARGS\]' 'lint \[PART' 'scripts'; do expect "help names $word" 0 "${word//|/\\|}"; done
verdict
