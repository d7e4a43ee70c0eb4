#!/usr/bin/env bash
# The first minute on a bare Debian 12, in a root of its own: see README.md beside this file.
set -Eeuo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
source "$root/tests/dev/checks.sh"
trap 'echo "FAILED: ${BASH_SOURCE[0]##*/}, line $LINENO: exit code $? from: $BASH_COMMAND"' ERR

cannot() {
  if [[ ${ANCHORD_FRESH_ROOT:-} == required ]]; then echo "FAILED: this test must run here and cannot: $*"; exit 1; fi
  echo "SKIPPED: the first minute on a bare Debian 12: $*"
  exit 77
}

if ((EUID != 0)); then
  [[ ${ANCHORD_FRESH_ROOT:-} == required ]] && sudo -n true 2>/dev/null &&
    exec sudo -n env PATH="$PATH" HOME="$HOME" ANCHORD_FRESH_ROOT=required ANCHORD_BINARY="${ANCHORD_BINARY:-}" "${BASH_SOURCE[0]}"
  cannot "not root"
fi
# Mounts and processes end with the namespace, however this test ends. Where a container forbids namespaces it goes on without.
if [[ -z ${ANCHORD_FRESH_ROOT_INSIDE:-} ]] && unshare --mount --pid --fork --kill-child --propagation private true 2>/dev/null; then
  ANCHORD_FRESH_ROOT_INSIDE=1 exec unshare --mount --pid --fork --kill-child --propagation private "${BASH_SOURCE[0]}" "$@"
fi
PATH=$PATH:/usr/sbin:/sbin
command -v debootstrap >/dev/null || cannot "no debootstrap (apt-get install debootstrap)"
command -v chroot >/dev/null || cannot "no chroot"

# This machine's own sources of Debian 12, as lines of a sources.list.
sources=$(apt-get indextargets --format 'deb $(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' 2>/dev/null |
  awk '$3 ~ /^bookworm(-updates|-security)?$/ && $4 == "main"')
mirror=$(awk '$3 == "bookworm" {print $2; exit}' <<<"$sources")
[[ -n $mirror ]] || cannot "apt here has no lists of Debian 12 bookworm (apt-get update)"

store=$root/build/fresh-root
new=$store/root
base=$store/base-$(sha256sum <<<"$sources" | cut -c1-12)
mkdir -p "$store/debs" "$store/npm"
finish() {
  [[ -n ${ANCHORD_FRESH_ROOT_KEEP:-} ]] || { umount "$new/proc" 2>/dev/null || true; rm -rf --one-file-system "$new"; }
}
trap finish EXIT
seconds_of() { printf '    %3d s  %s\n' $((SECONDS - begin)) "$1"; begin=$SECONDS; }
begin=$SECONDS

if [[ ! -d $base ]]; then
  rm -rf --one-file-system "$store"/base-*
  debootstrap --variant=minbase --cache-dir="$store/debs" bookworm "$base.part" "$mirror" >"$store/debootstrap.log" 2>&1 || {
    tail -n 5 "$store/debootstrap.log"
    cannot "debootstrap could not make the root (is the Debian mirror reachable?)"
  }
  mv "$base.part" "$base"
  seconds_of "debootstrap"
fi
umount "$new/proc" 2>/dev/null || true
rm -rf --one-file-system "$new"
cp -a "$base" "$new"

# What a machine's owner has set up before: where packages come from, whom to trust, the way out. Nothing else.
printf '%s\n' "$sources" >"$new/etc/apt/sources.list"
for place in etc/apt/trusted.gpg.d etc/apt/keyrings etc/apt/auth.conf.d usr/share/keyrings usr/local/share/ca-certificates; do
  [[ -d /$place ]] && mkdir -p "$new/$place" && cp -a "/$place/." "$new/$place/"
done
grep -lsE 'Proxy|Acquire::https' /etc/apt/apt.conf /etc/apt/apt.conf.d/* | xargs -r -I{} cp {} "$new/etc/apt/apt.conf.d/" || true
mkdir -p "$new/etc/ssl/certs"
[[ ! -e /etc/ssl/certs/ca-certificates.crt ]] || cp -L /etc/ssl/certs/ca-certificates.crt "$new/etc/ssl/certs/"
cp -L /etc/resolv.conf "$new/etc/resolv.conf"
rm -f "$new/etc/hosts"
# Speed only: no fsync for each package, nothing is started, packages downloaded once are not downloaded again.
echo force-unsafe-io >"$new/etc/dpkg/dpkg.cfg.d/speed"
printf '#!/bin/sh\nexit 101\n' >"$new/usr/sbin/policy-rc.d" && chmod +x "$new/usr/sbin/policy-rc.d"
echo 'APT::Keep-Downloaded-Packages "true";' >"$new/etc/apt/apt.conf.d/keep"
cp -al "$store"/debs/*.deb "$new/var/cache/apt/archives/" 2>/dev/null || true
keep_debs() { find "$new/var/cache/apt/archives" -name '*.deb' -exec cp -al -n {} "$store/debs/" \; ; }
mount -t proc proc "$new/proc" 2>/dev/null || echo "    without /proc in the root: mounting is not allowed here"

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
