#!/usr/bin/env bash
# The first minute on a bare Debian 12, in a root of its own: see README.md beside this file.
set -Eeuo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
source "$root/tests/dev/checks.sh"
trap 'echo "FAILED: ${BASH_SOURCE[0]##*/}, line $LINENO: exit code $? from: $BASH_COMMAND"' ERR

subject="the first minute on a bare Debian 12"
source "$root/tests/dev/bare_root.sh"

# The checkout, in a path with spaces: what git tracks or would; without git all but what is made here.
checkout="/home/a pilot/anchord checkout"
mkdir -p "$new$checkout"
if git -C "$root" rev-parse --is-inside-work-tree >/dev/null 2>&1; then
  git -C "$root" ls-files -z --cached --others --exclude-standard | tar -C "$root" --null --ignore-failed-read -cf - -T - 2>/dev/null
else
  tar -C "$root" --exclude=./build --exclude=./.git --exclude=node_modules --exclude=./.cache -cf - .
fi | tar -C "$new$checkout" -xf -
seconds_of "the root and the checkout in it"

# The way to the npm registry is this machine's too.
npm_config=()
for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY NODE_EXTRA_CA_CERTS; do
  [[ -z ${!name:-} ]] || npm_config+=("$name=${!name}")
done
for kind in user global; do
  file=$(npm config get "${kind}config" 2>/dev/null) || file=
  [[ -n $file && -e $file ]] || continue
  cp "$file" "$new/etc/npmrc-$kind"
  chmod 0644 "$new/etc/npmrc-$kind"
  npm_config+=("npm_config_${kind}config=/etc/npmrc-$kind")
done
mkdir -p "$new/var/cache/npm" && cp -a "$store/npm/." "$new/var/cache/npm/"
npm_config+=("npm_config_cache=/var/cache/npm")

path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
# in_root [chroot options --] COMMAND...: nothing of this machine's environment goes along, HOME neither.
in_root() {
  local -a options=()
  while [[ $1 == --* ]]; do [[ $1 == -- ]] && { shift; break; }; options+=("$1"); shift; done
  env -i PATH="$path" "${npm_config[@]}" chroot "${options[@]}" "$new" /bin/bash -c 'cd "$1" && shift && exec "$@"' bash "$checkout" "$@"
}
in_root useradd --create-home --home-dir "/home/a pilot" --shell /bin/bash pilot 2>/dev/null
as_pilot=(--userspec=pilot:pilot --)

# The sentences of the first minute.
attempt in_root "${as_pilot[@]}" ./dev setup
expect "an ordinary user in a checkout of root's" 1 '^dev: /home/a pilot/anchord checkout or its folder build is not writable for user pilot'
in_root chown -R pilot: "/home/a pilot"
attempt in_root "${as_pilot[@]}" ./dev setup
expect "an ordinary user without sudo" 1 'dev: not root and no sudo: run as root: apt-get install -y --no-install-recommends .*g\+\+'
# A machine that was never online: apt has no lists, and gets none.
if unshare --net true 2>/dev/null; then
  mv "$new/var/lib/apt/lists" "$new/var/lib/apt/lists.aside"
  attempt unshare --net env -i PATH="$path" chroot "$new" /bin/bash -c 'cd "$1" && ./dev setup' bash "$checkout"
  expect "no network" 1 $'\ndev: .*is there a network'
  rm -rf "$new/var/lib/apt/lists" && mv "$new/var/lib/apt/lists.aside" "$new/var/lib/apt/lists"
fi
seconds_of "what it says to an ordinary user, and without a network"

# The executable alone: @runtime and nothing of the build.
runtime=$(awk '{sub(/#.*/, "")} $2 == "@runtime" {print $1}' "$root/.ci/packages")
in_root apt-get -q update >"$store/apt.log" 2>&1
if [[ -x ${ANCHORD_BINARY:-} ]]; then
  # shellcheck disable=SC2086
  in_root env DEBIAN_FRONTEND=noninteractive apt-get -q install -y --no-install-recommends $runtime >>"$store/apt.log" 2>&1
  keep_debs
  cp "$ANCHORD_BINARY" "$new/usr/local/bin/anchord"
  attempt in_root anchord version
  expect "the executable with @runtime alone" 0 'anchord'
  in_root bash -c 'echo $$ >/tmp/pid; exec anchord serve --listen 127.0.0.1:0 --auth off --data-dir /tmp/data' >"$store/serve.log" 2>&1 &
  server=$!
  deadline=$((SECONDS + 60))
  until [[ -s $new/tmp/data/address ]] || ! kill -0 "$server" 2>/dev/null || ((SECONDS > deadline)); do sleep 0.2; done
  address=$(cat "$new/tmp/data/address" 2>/dev/null) || address=127.0.0.1:1
  address=${address#http://}
  # ask PATH JSON: the answer of the server in the root, whose loopback is ours.
  ask() {
    exec 9<>"/dev/tcp/${address%:*}/${address#*:}"
    printf 'POST %s HTTP/1.1\r\nHost: %s\r\nContent-Type: application/json\r\nContent-Length: %d\r\nConnection: close\r\n\r\n%s' "$1" "$address" "${#2}" "$2" >&9
    cat <&9
  }
  attempt ask /api/v1/sites '{"name":"x","origin":{"lat":51,"lon":3,"h_m":40},"crs":{"frame":"ETRS89"},"projected_epsg":25831}'
  site=$(sed -n 's/.*"id":"\([0-9a-f-]*\)".*/\1/p' <<<"$output")
  expect "the server in the root" 0 '201 '
  # On the central meridian of UTM zone 31 the easting is 500 km.
  attempt ask /api/v1/transform '{"from":"geo","to":"projected","site":"'"$site"'","points":[[3.0,51.0,40.0]]}'
  expect "its map projections (proj-data)" 0 '200 .*\[\[(500000|499999\.99)'
  kill "$(cat "$new/tmp/pid")" && wait "$server" || true
  seconds_of "the executable with @runtime alone"
else
  echo "    without ANCHORD_BINARY: @runtime was not tried"
fi

# setup_works WHO [chroot options --]: the package step, the Node step and the configuration.
setup_works() {
  local who=$1 ; shift
  attempt in_root "$@" ./dev setup
  printf '%s\n' "$output" >"$store/setup-$who.log"
  expect "./dev setup as $who" 0 'ready to build'
  [[ -s $new$checkout/build/release/build.ninja ]] || pass_or_fail 1 "./dev setup as $who made no build.ninja"
  attempt in_root "$@" build/node/node_modules/node/bin/node --version
  expect "the Node of $who" 0 '^v2[0-9]\.'
  keep_debs
  seconds_of "./dev setup as $who"
}
setup_works root
attempt in_root ./dev setup
expect "./dev setup again" 0 'ready to build'
[[ $output != *"installing"* ]] || pass_or_fail 1 "./dev setup again must install nothing" "$output"

# An ordinary user with sudo, to whom one package is missing, and all that root made here.
in_root env DEBIAN_FRONTEND=noninteractive apt-get -q install -y --no-install-recommends sudo >>"$store/apt.log" 2>&1
echo 'pilot ALL=(ALL) NOPASSWD: ALL' >"$new/etc/sudoers.d/pilot"
in_root apt-get -q remove -y libtomlplusplus-dev >>"$store/apt.log" 2>&1
rm -rf "$new$checkout/build"
in_root chown -R pilot: "/home/a pilot" /var/cache/npm
setup_works pilot "${as_pilot[@]}"
[[ $(cat "$store/setup-pilot.log") == *"installing 1 Debian packages: libtomlplusplus-dev"* ]] ||
  pass_or_fail 1 "the ordinary user's missing package was not installed" "$(cat "$store/setup-pilot.log")"
rm -rf "$store/npm" && cp -a "$new/var/cache/npm" "$store/npm"
verdict
