#!/usr/bin/env bash
# The Debian package on a bare Debian 12: installed, served, upgraded with its data, removed, purged. See README.md.
set -Eeuo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
source "$root/tests/dev/checks.sh"
trap 'echo "FAILED: ${BASH_SOURCE[0]##*/}, line $LINENO: exit code $? from: $BASH_COMMAND"' ERR
subject="the Debian package on a bare Debian 12"
new_name=install
source "$root/tests/dev/bare_root.sh"
[[ -x ${ANCHORD_BINARY:-} ]] || cannot "ANCHORD_BINARY names no executable"

export LC_ALL=C.UTF-8 SOURCE_DATE_EPOCH=1790000000
build=$(dirname "$ANCHORD_BINARY")
packages=$store/packages
rm -rf "$packages"
# One build as two versions: what an upgrade does depends on the number alone.
for version in 0.0.1 0.0.2; do
  (cd "$build" && umask 022 && cpack -G DEB -B "$packages/$version" -D CPACK_PACKAGE_VERSION=$version) >"$store/cpack.log" 2>&1 ||
    { tail -n 5 "$store/cpack.log"; exit 1; }
  cp "$packages/$version"/*.deb "$new/anchord-$version.deb"
done
seconds_of "two packages"

path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
in_root() { env -i PATH="$path" DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 chroot "$new" "$@"; }
apt() { in_root apt-get -q -y --no-install-recommends "$@"; }
apt update >"$store/install.log" 2>&1

attempt apt install /anchord-0.0.1.deb
printf '%s\n' "$output" >>"$store/install.log"
expect "the installation" 0 'Setting up anchord \(0\.0\.1\)'
keep_debs
attempt in_root stat -c '%U:%G %a' /var/lib/anchord
expect "its folder" 0 '^anchord:anchord 700$'
attempt in_root id -nG anchord
expect "its user" 0 'dialout'
attempt in_root anchord version
expect "the program" 0 'anchord '
seconds_of "installed"

# What the unit says, started as it would: there is no systemd in a bare root.
start=$(in_root sed -n 's/^ExecStart=//p' /lib/systemd/system/anchord.service)
serve() {
  in_root setpriv --reuid anchord --regid anchord --init-groups --no-new-privs bash -c 'echo $$ >/tmp/pid; exec '"$start" >"$store/installed.log" 2>&1 &
  server=$!
  local deadline=$((SECONDS + 60))
  until in_root anchord healthcheck --data-dir /var/lib/anchord >/dev/null 2>&1 || ! kill -0 "$server" 2>/dev/null || ((SECONDS > deadline)); do sleep 0.2; done
}
end() { kill "$(cat "$new/tmp/pid")" && wait "$server" || true; }
# Another server may have the port of the settings on this machine.
sed -i 's/127\.0\.0\.1:8420"\]$/127.0.0.1:0"]/' "$new/etc/anchord/anchord.toml"
echo '# a line of the administrator' >>"$new/etc/anchord/anchord.toml"
serve
attempt in_root anchord doctor --data-dir /var/lib/anchord
expect "anchord doctor" 0 'ok +server +http://127\.0\.0\.1:[0-9]+ answers'
attempt in_root setpriv --reuid anchord --regid anchord --init-groups anchord token create --data-dir /var/lib/anchord --role viewer --name kept
expect "a token" 0 'anc_'
token=$output
seconds_of "served, doctor"

# A stranger's path (docs/tutorial.md): a flight of one's own as CSV tables goes in, is solved and published, and GDAL reads the anchors.
address=$(cat "$new/var/lib/anchord/address") admin=$(cat "$new/var/lib/anchord/admin.token")
attempt in_root anchord simulate flight --seed 7 --out /root/my-flight
expect "CSV tables of a flight" 0 ''
mission=$(in_root anchord import flight /root/my-flight --url "$address" --token-file /var/lib/anchord/admin.token 2>>"$store/install.log") || true
ask() { curl -fsS -H "Authorization: Bearer $admin" -H 'Content-Type: application/json' "$@"; }
calibration=$(ask -H 'Prefer: wait=300' -d "{\"missions\":[\"$mission\"]}" "$address/api/v1/calibrations" | jq -r .id) || true
attempt ask -d '{"note":"first flight"}' "$address/api/v1/calibrations/$calibration/publish"
expect "published" 0 '"revision":1'
attempt ogrinfo -ro -so -oo "USERPWD=gis:$admin" "OAPIF:$address/ogc" anchors
expect "the anchors in a GIS" 0 'Geometry: 3D Point.*Feature Count: [1-9]'
seconds_of "a flight in, solved, published, read by GDAL"
end

attempt apt install /anchord-0.0.2.deb
expect "the upgrade" 0 'Setting up anchord \(0\.0\.2\)'
grep -q 'a line of the administrator' "$new/etc/anchord/anchord.toml" ; pass_or_fail $? "the upgrade changed the administrator's settings"
serve
attempt in_root setpriv --reuid anchord --regid anchord --init-groups anchord token list --data-dir /var/lib/anchord
expect "the data after the upgrade" 0 'kept'
end
seconds_of "upgraded"

attempt apt remove anchord
expect "the removal" 0 "are kept in /var/lib/anchord.*apt-get purge anchord"
[[ -s $new/var/lib/anchord/anchord.db && -s $new/etc/anchord/anchord.toml ]] ; pass_or_fail $? "the removal took data or settings"
[[ ! -e $new/usr/bin/anchord ]] ; pass_or_fail $? "the removal left the program"
attempt apt purge anchord
expect "the purge" 0 'Deleting /var/lib/anchord'
[[ ! -e $new/var/lib/anchord && ! -e $new/etc/anchord ]] ; pass_or_fail $? "the purge left data or settings"
seconds_of "removed, purged"

# --- The image, where no engine is: the steps of .ci/Dockerfile behind its build stage, then what docker-compose.yml starts in it, as its
# user, in a network of its own, on a root that is read-only but for /data and /tmp. What the package needed is installed here already;
# tests/dev/fresh_root.test.sh begins with nothing.
image=$(awk '/^FROM/ {n++} n == 2' "$root/.ci/Dockerfile" | sed -e ':a' -e '/\\$/{N;s/\\\n//;ta' -e '}')
environment=()
while read -r word rest; do
  case $word in
    RUN) attempt in_root bash -c "$rest" ; expect "RUN of .ci/Dockerfile" 0 '' ;;
    COPY) [[ $rest == --from=* ]] && install -D -m 0755 "$ANCHORD_BINARY" "$new/usr/local/bin/anchord" || cp "$root/${rest% *}" "$new${rest##* }" ;;
    ENV) environment+=("$rest") ;;
    USER) user=$rest ;;
  esac
done <<<"$image"
compose() { /usr/bin/python3 -c 'import sys, yaml, shlex
one = yaml.safe_load(open(sys.argv[1]))["services"]["anchord"]
print(shlex.join(one["command"] if sys.argv[2] == "command" else one["healthcheck"]["test"][1:]))' "$root/docker-compose.yml" "$1"; }
entry=$(sed -n 's/^ENTRYPOINT \["\(.*\)"\]$/\1/p' "$root/.ci/Dockerfile")
if mount --bind "$new" "$new" 2>/dev/null && unshare --net true 2>/dev/null; then
  mount -t proc proc "$new/proc" && mount -t tmpfs tmpfs "$new/tmp" && mount -t tmpfs -o "uid=${user%:*},gid=${user#*:},mode=0700" tmpfs "$new/data" &&
    mount -o remount,bind,ro "$new"
  attempt unshare --net bash -c 'ip link set lo up
    run=(env -i '"${environment[*]}"' /usr/sbin/chroot --userspec='"$user $new"')
    "${run[@]}" '"$entry $(compose command)"' >'"$store"'/image.log 2>&1 & server=$!
    for _ in {1..200}; do "${run[@]}" '"$(compose healthcheck)"' 2>/dev/null && break; sleep 0.1; done
    "${run[@]}" '"$(compose healthcheck)"' && echo healthy; "${run[@]}" /usr/bin/id -u; "${run[@]}" /usr/bin/pdftoppm -v 2>&1 | head -n 1
    "${run[@]}" /usr/bin/touch /usr/bin/x 2>&1; kill $server; wait $server; echo "ended with $?"'
  expect "the image" 0 'healthy.65532.pdftoppm version.*Read-only file system.ended with 0'
  umount -R "$new"
else
  echo "    without mounts or a network of its own: the image was not run"
fi
seconds_of "the image"
verdict
