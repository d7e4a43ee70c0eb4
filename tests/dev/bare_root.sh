# A minimal Debian 12 of its own for a test of this folder: sourced, never run. The test sets `subject` (for the sentence of a
# skip) and `root`, and may set `new_name`. After it: $new is the root with this machine's package sources, $store is kept
# between runs, keep_debs keeps what was downloaded, seconds_of prints times, and everything ends with the test.
cannot() {
  if [[ ${ANCHORD_FRESH_ROOT:-} == required ]]; then echo "FAILED: this test must run here and cannot: $*"; exit 1; fi
  echo "SKIPPED: $subject: $*"
  exit 77
}

if ((EUID != 0)); then
  [[ ${ANCHORD_FRESH_ROOT:-} == required ]] && sudo -n true 2>/dev/null &&
    exec sudo -n env PATH="$PATH" HOME="$HOME" ANCHORD_FRESH_ROOT=required ANCHORD_BINARY="${ANCHORD_BINARY:-}" "$0"
  cannot "not root"
fi
# Mounts and processes end with the namespace, however this test ends. Where a container forbids namespaces it goes on without.
if [[ -z ${ANCHORD_FRESH_ROOT_INSIDE:-} ]] && unshare --mount --pid --fork --kill-child --propagation private true 2>/dev/null; then
  ANCHORD_FRESH_ROOT_INSIDE=1 exec unshare --mount --pid --fork --kill-child --propagation private "$0" "$@"
fi
PATH=$PATH:/usr/sbin:/sbin
command -v debootstrap >/dev/null || cannot "no debootstrap (apt-get install debootstrap)"
command -v chroot >/dev/null || cannot "no chroot"

source "$root/.dev/sources.sh"
sources=$(debian_sources)
mirror=$(awk '$3 == "bookworm" {print $2; exit}' <<<"$sources")
[[ -n $mirror ]] || cannot "apt here has no lists of Debian 12 bookworm (apt-get update)"

store=$root/build/fresh-root
new=$store/${new_name:-root}
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
