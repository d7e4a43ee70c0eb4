#!/usr/bin/env bash
# Nothing of ./dev ends without a sentence.
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
source "$root/tests/dev/checks.sh"
scratch=$(mktemp -d "${TMPDIR:-/tmp}/anchord dev XXXXXX")
trap 'chmod -R u+w "$scratch"; rm -rf "$scratch"' EXIT

# A copy of the scripts in a path with spaces, and nothing else of the project.
fresh_copy() {
  rm -rf "$scratch/checkout"
  mkdir -p "$scratch/checkout"
  cp -R "$root/dev" "$root/.dev" "$root/.ci" "$scratch/checkout/"
}

# planted WHAT PATTERN BODY: BODY as the command `lint` must end with a sentence that matches.
planted() {
  fresh_copy
  printf 'cmd_lint() {\n%s\n  echo "went on"\n}\nhelper() { grep -q something /dev/null; }\n' "$3" >"$scratch/checkout/.dev/lint.sh"
  attempt "$scratch/checkout/dev" lint
  expect "$1" fails "$2"
  [[ $output != *"went on"* ]] ; pass_or_fail $? "$1: must not go on after the failure" "$output"
  local sentences
  sentences=$(grep -c '^dev: .*exit code' <<<"$output")
  [[ $sentences == 1 ]] ; pass_or_fail $? "$1: one sentence, not $sentences" "$output"
}
planted "a plain command" 'dev: \.dev/lint\.sh, line 2: exit code 1 from: false' '  false'
planted "a command that is not there" 'line 2: exit code 127 from: no-such-program --x' '  no-such-program --x'
planted "a function" 'lint\.sh, line 5: exit code 1 from: .*grep -q something /dev/null' '  helper'
planted "the first of a pipeline" 'line 2: exit code 1 from: grep x /dev/null \| cat' '  grep x /dev/null | cat'
planted "a function in a pipeline" 'line 5: exit code 1 from: .*grep -q something' '  helper | cat'
planted "a command substitution" 'line 2: exit code 1 from: x=\$\(grep x /dev/null\)' '  x=$(grep x /dev/null)'
planted "the first of two in a substitution" 'line 2: exit code 1 from: x=\$\(false; echo y\)' '  x=$(false; echo y)'
planted "a function in a substitution in a pipeline" 'line 5: exit code 1 from: .*grep -q something' '  x=$(helper | tr a b) ; echo "$x"'
planted "a subshell" 'line 2: exit code 1 from: \(cd /no/such/folder' '  (cd /no/such/folder && pwd)'
planted "a redirection" 'line 2: exit code 1 from: echo x >/no/such/file' '  echo x >/no/such/file'
planted "a here-string loop" 'line 3: exit code 3 from: \(exit 3\)' $'  while read -r x; do\n(exit 3)\n  done <<<"a"'

fresh_copy
printf 'cmd_lint() { x=$(inner); echo went on; }\ninner() { die "no such thing as 3 m"; }\n' >"$scratch/checkout/.dev/lint.sh"
attempt "$scratch/checkout/dev" lint
expect "die in a substitution" fails '^dev: no such thing as 3 m$'
fresh_copy
printf 'cmd_lint() { echo "$no_such_variable"; }\n' >"$scratch/checkout/.dev/lint.sh"
attempt "$scratch/checkout/dev" lint
expect "an unset variable" fails 'no_such_variable: unbound variable'
attempt "$scratch/checkout/dev" no-such-command
expect "an unknown command" fails "there is no command 'no-such-command'"

# Machines that lack something. A folder of links to chosen programs is the whole PATH.
path_without() {
  local tool
  rm -rf "$scratch/bin" ; mkdir "$scratch/bin"
  for tool in awk cat chmod cut dirname dpkg dpkg-query apt-get apt-cache env grep id ls mkdir nproc paste rm sed seq sha256sum sleep tail \
    tee tr uname wc xargs bash; do
    [[ " $* " == *" $tool "* ]] || ln -s "$(command -v "$tool")" "$scratch/bin/$tool"
  done
}
bare() { env -i PATH="$scratch/bin" "$@"; }
fresh_copy
path_without awk sed
attempt bare "$scratch/checkout/dev" build
expect "no awk, no sed" 1 'this machine has no awk sed: install'
path_without apt-get
attempt bare "$scratch/checkout/dev" build
expect "no apt-get" 1 'this needs Debian 12: no apt-get here'
path_without
: >"$scratch/checkout/.ci/packages"
attempt bare "$scratch/checkout/dev" build
expect "an empty package list" 1 '\.ci/packages lists nothing'
fresh_copy
echo 'no-such-package-of-debian' >"$scratch/checkout/.ci/packages"
if ((EUID != 0)); then
  path_without
  attempt bare "$scratch/checkout/dev" build
  expect "neither root nor sudo" 1 'not root and no sudo: run as root: apt-get install .*no-such-package-of-debian'
fi
path_without nproc git
printf 'cmd_lint() { echo "jobs $(jobs_count) home $HOME"; }\n' >"$scratch/checkout/.dev/lint.sh"
attempt bare "$scratch/checkout/dev" lint
expect "no nproc, no home" 0 'jobs 1 home /'
attempt bare HOME=/proc/1/no/such/home "$scratch/checkout/dev" lint
expect "a home that cannot be written" 0 'jobs 1 home .*/checkout/build/home'
attempt bare LC_ALL=xx_YY.ISO-8859-1 LANG=tr_TR "$scratch/checkout/dev" help
expect "a locale that is not there" 0 'usage: ./dev COMMAND'
fresh_copy
printf 'cmd_lint() { own_sources | wc -l; }\n' >>"$scratch/checkout/.dev/lint.sh"
attempt bare "$scratch/checkout/dev" lint
expect "no git" 1 'read the list of files from git'
fresh_copy
if ((EUID != 0)); then
  chmod a-w "$scratch/checkout"
  attempt "$scratch/checkout/dev" build
  expect "a checkout that cannot be written" 1 'is not writable for user'
  chmod u+w "$scratch/checkout"
fi

# Forms in which bash hides a failure from the trap.
found=$(cd "$root" && grep -nE '^[^#]*(\b(local|export|readonly|declare)( -[a-zA-Z]+)* [a-z_A-Z]+="?[^ ]*\$\(|< <\()' dev .dev/*.sh .ci/run)
[[ -z $found ]] ; pass_or_fail $? "local x=\$(...) and < <(...) hide a failure: assign on a line of its own, read from <<<" "$found"
found=$(cd "$root" && for file in dev .ci/run; do grep -q 'set -Eeuo pipefail' "$file" || echo "$file"; done)
[[ -z $found ]] ; pass_or_fail $? "without set -Eeuo pipefail" "$found"

# A machine without /etc/hosts runs the tests too. Host headers are text, and stay.
found=$(cd "$root" && grep -rnE --exclude-dir=node_modules '(://|listen\(|connect\(|host: *.)localhost' tests server drivers web/test web/*.ts .dev --include='*.mjs' --include='*.ts' --include='*.sh' --include='*.cpp' --include='*.hpp' |
  grep -vE 'request_check_test|origin_allowed|baseURI|tobe\(|toBe\(')
[[ -z $found ]] ; pass_or_fail $? "no test needs localhost to resolve: write 127.0.0.1" "$found"

verdict
