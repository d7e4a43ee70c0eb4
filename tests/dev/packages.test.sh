#!/usr/bin/env bash
# .ci/packages lists what is used and nothing else; @runtime is what the executable needs, @recommended what it runs and can do without.
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root" || exit 1
source tests/dev/checks.sh
listed() { awk -v group="$1" '{sub(/#.*/, "")} NF && $2 == group {print $1}' .ci/packages; }   # listed "" | @GROUP
twice=$(awk '{sub(/#.*/, "")} NF {print $1, $2}' .ci/packages | sort | uniq -d)
[[ -z $twice ]] ; pass_or_fail $? ".ci/packages lists a package twice" "$twice"
unknown=$(awk '{sub(/#.*/, "")} NF > 1 {print $2}' .ci/packages | sort -u | grep -vxE '@(runtime|recommended|test|lint|coverage|fuzz|bench|fresh|arm64|cluster)')
[[ -z $unknown ]] ; pass_or_fail $? "groups that no command installs" "$unknown"

# --- nothing that nobody uses: a library's header is included somewhere, a program is named somewhere.
# Data and halves of another package, used without being named:
data=" python3 ca-certificates proj-data libclang-rt-16-dev pkg-config "
includes=$(grep -rhoE '^ *# *include *<[^>]+>' --include='*.cpp' --include='*.hpp' api core drivers server migrations tests | grep -oE '<[^>]+' | tr -d '<' | sort -u)
own=(dev .dev .ci/run api core drivers server web tests migrations CMakeLists.txt CMakePresets.json docs)
for package in $(listed "") $(listed @test) $(listed @bench) $(listed @lint) $(listed @coverage) $(listed @fuzz) $(listed @fresh) $(listed @arm64); do
  [[ $data == *" $package "* ]] && continue
  files=$(dpkg -L "$package" 2>/dev/null) || continue   # of a group that is not installed here
  headers=$(grep -E '^/usr/include/.*[^/]$' <<<"$files")
  if [[ $package == lib*-dev || $package == *-dev ]] && [[ -n $headers ]]; then
    # A header is included by the end of its path: <sqlite3.h>, <Eigen/Core>.
    used=$(awk 'NR == FNR {want[$0] = 1; next} {n = split($0, p, "/"); s = p[n]; if (s in want) {print s; exit}
      for (i = n - 1; i > 2; i--) {s = p[i] "/" s; if (s in want) {print s; exit}}}' <(printf '%s\n' "$includes") <(printf '%s\n' "$headers"))
    [[ -n $used ]] ; pass_or_fail $? "no source includes a header of $package: take it out of .ci/packages"
  else
    used=
    for program in $(grep -E '^(/usr)?/s?bin/[^/]+$' <<<"$files" | sed 's|.*/||'); do
      grep -rqwF --exclude-dir=node_modules --exclude-dir=build -e "$program" "${own[@]}" && { used=$program; break; }
    done
    # Neither headers nor programs: a library that is loaded by its name.
    [[ -n $used ]] || { grep -rqF --exclude-dir=node_modules --exclude-dir=build -e "$package" "${own[@]}" && used=$package; }
    [[ -n $used || $package == python3-* ]] || [[ $package == g++ || $package == ninja-build ]]
    pass_or_fail $? "nothing runs a program of $package: take it out of .ci/packages"
  fi
done
grep -q '^import yaml' api/embed_contract.py ; pass_or_fail $? "python3-yaml is not imported any more"

# --- @runtime: packages of the libraries that the executable names, and the data they read.
if [[ -x ${ANCHORD_BINARY:-} ]] && command -v readelf >/dev/null; then
  where=$(ldd "$ANCHORD_BINARY")
  needed=proj-data
  for library in $(readelf -d "$ANCHORD_BINARY" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'); do
    case $library in
      # Several packages provide these two; ours is the one that libceres-dev brings.
      libblas.so.3 | liblapack.so.3) needed+=$'\nlibatlas3-base' ; continue ;;
    esac
    file=$(awk -v name="$library" '$1 == name {print $3}' <<<"$where")
    [[ $library == ld-linux* ]] && file=$(readlink -f "/lib64/$library")
    file=$(readlink -f "$file")
    # Debian 12 has /lib in /usr/lib, and the files under either name.
    package=$(dpkg -S "$file" 2>/dev/null || dpkg -S "${file#/usr}" 2>/dev/null || dpkg -S "/usr$file" 2>/dev/null || echo "nobody's:$library")
    needed+=$'\n'${package%%:*}
  done
  difference=$(diff <(sort -u <<<"$needed") <(listed @runtime | sort -u))
  [[ -z $difference ]] ; pass_or_fail $? "@runtime of .ci/packages and the executable disagree (< executable, > list)" "$difference"
  grep -q '@runtime' .ci/Dockerfile ; pass_or_fail $? ".ci/Dockerfile does not install @runtime"
else
  echo "@runtime was not compared: no ANCHORD_BINARY or no readelf"
fi

# --- @recommended: programs that the worker runs by name, and nothing else; the error says which package is missing.
sources=(api core drivers server)
run=$(grep -rhoE --include='*.cpp' '\brun\(\{"[^"/]+"' "${sources[@]}" | sed 's/.*"\(.*\)"/\1/' | sort -u)
[[ -n $run ]] ; pass_or_fail $? "no program is found that the worker runs: this test looks for run({\"NAME\""
programs=()
for package in $(listed @recommended); do
  files=$(dpkg -L "$package" 2>/dev/null | grep '^/usr/bin/') || { echo "$package was not compared: it is not installed"; continue; }
  own_programs=$(grep -xFf <(sed 's|^|/usr/bin/|' <<<"$run") <<<"$files")
  [[ -n $own_programs ]] ; pass_or_fail $? "the worker runs no program of $package: take it out of @recommended"
  mapfile -t -O ${#programs[@]} programs <<<"$own_programs"
  grep -rqF --include='*.cpp' "install $package" "${sources[@]}" ; pass_or_fail $? "no error says: install $package"
done
for program in $run; do
  package=$(dpkg -S "/usr/bin/$program" 2>/dev/null | cut -d: -f1)
  [[ -z $package ]] || grep -qx "$package" <(listed @recommended)
  pass_or_fail $? "the worker runs $program of $package, which is not @recommended"
done

# A server to which its programs are not there: what else it does goes on, and what needs them says what to install.
if [[ -x ${ANCHORD_BINARY:-} && ${#programs[@]} -gt 0 ]] && unshare --mount true 2>/dev/null; then
  data=$(mktemp -d)
  unshare --mount --propagation private bash -c 'for program in "${@:3}"; do mount --bind /dev/null "$program" || exit 1; done
    exec "$1" serve --listen 127.0.0.1:0 --auth=off --data-dir "$2"' _ "$ANCHORD_BINARY" "$data" "${programs[@]}" >"$data/log" 2>&1 &
  server=$!
  trap 'kill "$server" 2>/dev/null; wait "$server"; rm -rf "$data"' EXIT
  url=
  for ((i = 0; i < 600 && ${#url} == 0; i++)); do
    url=$(grep -oE 'http://127\.0\.0\.1:[1-9][0-9]*' "$data/log" | head -n 1)
    sleep 0.1
  done
  api() { curl -sS -H 'Content-Type: application/json' "$@"; }
  site=$(api "$url/api/v1/sites" -d '{"name":"S","origin":{"lon":3.7,"lat":51,"h_m":50}}' | jq -r .id)
  building=$(api "$url/api/v1/buildings" -d '{"name":"B","site":"'"$site"'"}' | jq -r .id)
  floor=$(api "$url/api/v1/floors" -d '{"name":"F","level":0,"building":"'"$building"'"}' | jq -r .id)
  answer=$(curl -sS -X PUT -H 'If-Match: "f-1"' -H 'Content-Type: application/pdf' --data-binary '%PDF-1.7' "$url/api/v1/floors/$floor/plan")
  [[ $(jq -r .status <<<"$answer") == 415 && $answer == *"install poppler-utils"* ]]
  pass_or_fail $? "without poppler-utils a PDF is not 415 with what to install" "$answer"
else
  echo "a server without what is recommended was not tried: no ANCHORD_BINARY, no programs, or no mount namespace"
fi
verdict
