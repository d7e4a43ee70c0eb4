#!/usr/bin/env bash
# .ci/packages lists what is used and nothing else; @runtime is what the executable needs.
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root" || exit 1
source tests/dev/checks.sh
listed() { awk -v group="$1" '{sub(/#.*/, "")} NF && $2 == group {print $1}' .ci/packages; }   # listed "" | @GROUP
twice=$(awk '{sub(/#.*/, "")} NF {print $1, $2}' .ci/packages | sort | uniq -d)
[[ -z $twice ]] ; pass_or_fail $? ".ci/packages lists a package twice" "$twice"
unknown=$(awk '{sub(/#.*/, "")} NF > 1 {print $2}' .ci/packages | sort -u | grep -vxE '@(runtime|recommended|test|lint|coverage|fuzz|bench|fresh)')
[[ -z $unknown ]] ; pass_or_fail $? "groups that no command installs" "$unknown"

# --- nothing that nobody uses: a library's header is included somewhere, a program is named somewhere.
# Data and halves of another package, used without being named:
data=" python3 ca-certificates proj-data libclang-rt-16-dev pkg-config "
includes=$(grep -rhoE '^ *# *include *<[^>]+>' --include='*.cpp' --include='*.hpp' api core drivers server migrations tests | grep -oE '<[^>]+' | tr -d '<' | sort -u)
own=(dev .dev .ci/run api core drivers server web tests migrations CMakeLists.txt CMakePresets.json docs)
for package in $(listed "") $(listed @test) $(listed @bench) $(listed @lint) $(listed @coverage) $(listed @fuzz) $(listed @fresh); do
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
verdict
