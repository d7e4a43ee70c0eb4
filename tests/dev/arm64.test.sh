#!/usr/bin/env bash
# The server and CLI built for arm64, run under qemu-user, beside this machine's own build: the same words, the same anchors, the same package.
# ./dev test --arm64 builds both and runs this; see README.md.
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root" || exit 1
source tests/dev/checks.sh
for name in ANCHORD_BINARY ARM64_BINARY ARM64_ROOT; do
  [[ -e ${!name:-} ]] || { echo "FAILED: $name names nothing: run ./dev test --arm64"; exit 1; }
done
scratch=$(mktemp -d)
server=
finish() { [[ -z $server ]] || kill "$server" 2>/dev/null; rm -rf "$scratch"; }
trap finish EXIT
export PROJ_DATA=$ARM64_ROOT/usr/share/proj SOURCE_DATE_EPOCH=1790000000
arm64() { qemu-aarch64-static -L "$ARM64_ROOT" "$ARM64_BINARY" "$@"; }
native() { "$ANCHORD_BINARY" "$@"; }

attempt readelf -h "$ARM64_BINARY"
expect "the executable" 0 'Machine: +AArch64'
attempt arm64 --version
expect "the program under qemu" 0 "^$(native --version | cut -d' ' -f1-2)"

# One flight, solved by both. The instruction sets differ in how they fuse and add, hence not the last digits.
native simulate flight --seed 7 --out "$scratch/flight" >"$scratch/simulate.log" 2>&1 ; pass_or_fail $? "a simulated flight" "$(tail -n 3 "$scratch/simulate.log")"
for one in arm64 native; do
  $one solve "$scratch/flight" --format json >"$scratch/$one.json" 2>"$scratch/$one.log"
  pass_or_fail $? "solve by $one" "$(tail -n 3 "$scratch/$one.log")"
done
anchors() { jq -c '[.flights[0].anchors[] | {network_id, verdict, enu_m}]' "$scratch/$1.json"; }
attempt jq -nr --argjson a "$(anchors arm64)" --argjson b "$(anchors native)" '
  [range([$a, $b | length] | max) | select($a[.].network_id != $b[.].network_id or $a[.].verdict != $b[.].verdict or
    ([[$a[.].enu_m, $b[.].enu_m] | transpose[] | .[0] - .[1] | fabs] | max) > 1e-5)] as $odd |
  if ($odd | length) == 0 then "\($a | length) anchors agree" else "not alike: \($odd | map([$a[.], $b[.]]))" end'
expect "anchors of both, within 0.01 mm" 0 '^6 anchors agree'

# The server: a mission and its rows in, the same rows out, a clean end.
qemu-aarch64-static -L "$ARM64_ROOT" "$ARM64_BINARY" serve --listen 127.0.0.1:0 --auth=off --data-dir "$scratch/data" >"$scratch/serve.log" 2>&1 &
server=$!
deadline=$((SECONDS + 120)) url=
until [[ -n $url ]] || ((SECONDS > deadline)) || ! kill -0 "$server" 2>/dev/null; do
  url=$(grep -o -m1 'http://127\.0\.0\.1:[0-9]*' "$scratch/serve.log") || sleep 0.2
done
attempt curl -fsS "$url/version"
expect "the server" 0 '"version"'
attempt curl -fsS "$url/"
expect "the dashboard" 0 '<title>'
attempt native import flight "$scratch/flight" --url "$url"
expect "a flight brought to it" 0 '5760 rows accepted'
mission=$(curl -fsS "$url/api/v1/missions" | jq -r '.items[0].id')
attempt curl -fsS "$url/api/v1/ranges?mission=$mission&limit=1"
expect "its ranges" 0 '"distance_m"'
attempt curl -fsS "$url/api/v1/transform" -H 'content-type: application/json' -d '{"from": "crs", "crs": "UTM 31N", "to": "geo", "points": [[549900, 5652600, 60]]}'
expect "map coordinates by PROJ" 0 '\[3\.711486567[0-9]*,51\.022789202'
kill "$server" && wait "$server"
pass_or_fail $? "the server's end" "$(tail -n 3 "$scratch/serve.log")"
server=

(cd "$(dirname "$ARM64_BINARY")" && umask 022 && cpack -G DEB -B "$scratch/package") >"$scratch/package.log" 2>&1
pass_or_fail $? "cpack" "$(tail -n 5 "$scratch/package.log")"
attempt dpkg-deb --field "$scratch"/package/anchord_*_arm64.deb Architecture Depends
expect "the package" 0 'Architecture: arm64.*libc6'
attempt dpkg-deb --contents "$scratch"/package/anchord_*_arm64.deb
expect "its manual page, printed by the program under qemu" 0 'man1/anchord\.1\.gz'
verdict
