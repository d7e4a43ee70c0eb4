#!/usr/bin/env bash
# The Debian package: what is in it, that its SBOM names what the executable needs, that two builds are the same bytes.
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root" || exit 1
source tests/dev/checks.sh
[[ -x ${ANCHORD_BINARY:-} ]] || { echo "FAILED: ANCHORD_BINARY names no executable"; exit 1; }
build=$(dirname "$ANCHORD_BINARY")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export LC_ALL=C.UTF-8 SOURCE_DATE_EPOCH=1790000000   # 2026-09-21

# make NAME: a package in a folder of its own; the umask is that of ./dev package.
make() {
  (cd "$build" && umask 022 && cpack -G DEB -B "$scratch/$1") >"$scratch/$1.log" 2>&1
  pass_or_fail $? "cpack makes a package" "$(tail -n 5 "$scratch/$1.log")"
}
make first
make second
one=$(echo "$scratch"/first/*.deb) two=$(echo "$scratch"/second/*.deb)
cmp -s "$one" "$two" ; pass_or_fail $? "two packages of one build differ" "$(sha256sum "$one" "$two")"

attempt dpkg-deb --info "$one"
expect "its description" 0 'Package: anchord'
listed=$(awk '{sub(/#.*/, "")} $2 == "@runtime" {print $1}' .ci/packages | sort)
depends=$(dpkg-deb --field "$one" Depends | tr ',' '\n' | awk '{print $1}' | grep -vx adduser | sort)
[[ $listed == "$depends" ]] ; pass_or_fail $? "Depends and @runtime of .ci/packages disagree" "$(diff <(echo "$listed") <(echo "$depends"))"
dpkg-deb --info "$one" conffiles | grep -qx /etc/anchord/anchord.toml ; pass_or_fail $? "the settings are no conffile"

dpkg-deb --raw-extract "$one" "$scratch/tree" || exit 1
tree=$scratch/tree
doc=$tree/usr/share/doc/anchord
for file in usr/bin/anchord lib/systemd/system/anchord{,-gateway,-worker}.service lib/udev/rules.d/60-anchord-pozyx.rules etc/anchord/anchord.toml \
  usr/share/man/man1/anchord.1.gz usr/share/bash-completion/completions/anchord usr/share/zsh/vendor-completions/_anchord \
  usr/share/doc/anchord/{copyright,changelog.gz,CHANGELOG.md.gz,operations.md,anchord.spdx.json,licences.txt.gz}; do
  [[ -s $tree/$file ]] ; pass_or_fail $? "/$file is not in the package"
done
odd=$(find "$tree" -not -path '*/DEBIAN*' -printf '%m %y %P\n' | awk '$2 == "d" && $1 != 755 || $2 == "f" && $1 != ($3 ~ /^usr\/bin\// ? 755 : 644)')
[[ -z $odd ]] ; pass_or_fail $? "modes that are odd in a package" "$odd"
empty=$(find "$tree" -type d -empty)
[[ -z $empty ]] ; pass_or_fail $? "empty folders in the package" "$empty"
foreign=$(dpkg-deb --contents "$one" | awk '$2 != "root/root"')
[[ -z $foreign ]] ; pass_or_fail $? "files that are not root's" "$foreign"
[[ $(sed -n 1p "$tree/usr/share/zsh/vendor-completions/_anchord") == '#compdef anchord' ]]
pass_or_fail $? "zsh loads a completion by its first line"
attempt man --warnings -E UTF-8 -l "$tree/usr/share/man/man1/anchord.1.gz"
expect "the manual page" 0 'anchord serve'
attempt "$tree/usr/bin/anchord" config check --config "$tree/etc/anchord/anchord.toml"
expect "the settings of the package" 0 ''
# The units of gateway and worker: the sandbox of the server, command lines that anchord reads, off until they are enabled.
units=$tree/lib/systemd/system
sandbox() { grep -E '^(NoNew|Capability|Protect|Private|Restrict|Lock|Memory|RemoveIPC|SystemCall|DevicePolicy)' "$units/$1.service"; }
for unit in anchord-gateway anchord-worker; do
  [[ $(sandbox $unit) == "$(sandbox anchord)" ]] ; pass_or_fail $? "the sandbox of $unit is another than the server's"
  ! grep -q "enable.*$unit" "$tree/DEBIAN/postinst" ; pass_or_fail $? "$unit is enabled by the package"
  file=$(sed -n 's/^EnvironmentFile=//p' "$units/$unit.service") kind=${unit#anchord-}
  grep -qF "$file" "docs/$kind.md" 2>/dev/null || grep -qF "$file" "docs/${kind}s.md" ; pass_or_fail $? "no page names $file"
  start=$(sed -n "s|^ExecStart=/usr/bin/anchord \\([a-z]*\\).*|\\1|p" "$units/$unit.service")
  attempt "$tree/usr/bin/anchord" "$start" --help
  expect "the command of $unit" 0 "--log-level"
done
attempt readelf -S "$tree/usr/bin/anchord"
[[ $output != *.debug_info* ]] ; pass_or_fail $? "the executable is not stripped"

# --- Debian's own check of packages: no error. What it says of less weight is printed.
attempt lintian --fail-on error "$one"
printf '%s\n' "$output" | sed 's/^/    /'
expect "lintian" 0 ''

# --- Compose: the form of the file, with every profile.
for profile in field mqtt https cluster; do
  attempt docker-compose -f docker-compose.yml --profile "$profile" config --quiet
  expect "docker-compose.yml with profile $profile" 0 ''
done
# Without these Caddy's requests are refused, for the server knows nobody of that name.
attempt env ANCHORD_ALLOWED_HOSTS=anchord.example ANCHORD_TRUSTED_PROXIES=172.16.0.0/12 docker-compose -f docker-compose.yml --profile https config
expect "the name of the server in a container" 0 'ANCHORD_ALLOWED_HOSTS: anchord.example'
expect "the proxy of the server in a container" 0 'ANCHORD_TRUSTED_PROXIES: 172.16.0.0/12'

# --- Its cluster: nothing is weaker than the first service, no password is in the file, each command line of ours is one that anchord reads.
found=$(docker-compose -f docker-compose.yml --profile cluster config | /usr/bin/python3 -c '
import shlex, sys, yaml
services = yaml.safe_load(sys.stdin)["services"]
hardened = {"read_only": True, "cap_drop": ["ALL"], "security_opt": ["no-new-privileges:true"]}
for name, one in services.items():
    if one.get("profiles") != ["cluster"]: continue
    for key, value in hardened.items():
        if one.get(key) != value: print("weak", name, key)
    if "healthcheck" not in one or "restart" not in one: print("weak", name, "healthcheck, restart")
    for port in one.get("ports", []):
        if not str(port).startswith("127.0.0.1:"): print("weak", name, port)
    settings = one.get("environment", {})
    for key, value in settings.items():
        if "PASSWORD" in key and not str(value).startswith("/run/secrets/"): print("weak", name, key)
    if "build" not in one: continue
    given = [key + "=" + str(value) for key, value in settings.items() if key.startswith("ANCHORD_")]
    for what, words in (("command", one["command"]), ("health", one["healthcheck"]["test"][2:])):
        print(what, shlex.join(["env", *given, sys.argv[1], *words]).replace("@postgres/", "@127.0.0.1:1/").replace(":8420", ":1") if what == "health" or words[0] == "worker"
              else shlex.join(["env", *given, sys.argv[1], "config", "check", *words[1:]]))
' "$ANCHORD_BINARY")
weak=$(grep '^weak' <<<"$found")
[[ -z $weak ]] ; pass_or_fail $? "the cluster of docker-compose.yml is weaker than its first service" "$weak"
[[ $(grep -c '^command' <<<"$found") == 3 && $(grep -c '^health' <<<"$found") == 3 ]] ; pass_or_fail $? "two servers and a worker are not found in" "$found"
while read -r what line; do
  attempt timeout 20 bash -c "$line"
  # What reads well and finds nobody at port 1 ends with 1; what it cannot read ends with 2.
  if [[ $line == *" config check "* ]]; then expect "$line" 0 'configuration is valid'; else expect "$line" 1 '127\.0\.0\.1'; fi
done <<<"$(grep -E '^(command|health)' <<<"$found")"
docs/examples/cluster/secrets.sh "$scratch/secrets" "$EUID"
missing=$(docker-compose -f docker-compose.yml --profile cluster config | /usr/bin/python3 -c '
import os, sys, yaml
for name, one in yaml.safe_load(sys.stdin)["secrets"].items():
    if not os.path.isfile(os.path.join(sys.argv[1], os.path.basename(one["file"]))): print(name)' "$scratch/secrets")
[[ -z $missing ]] ; pass_or_fail $? "secrets.sh does not make what docker-compose.yml wants" "$missing"
open=$(find "$scratch/secrets" \( -name '*.pgpass' -o -name '*.key' -o -type d \) -perm /077)
[[ -z $open ]] ; pass_or_fail $? "others than the owner reach secrets" "$open"
before=$(cat "$scratch"/secrets/*)
docs/examples/cluster/secrets.sh "$scratch/secrets" "$EUID"
[[ $before == "$(cat "$scratch"/secrets/*)" ]] ; pass_or_fail $? "secrets.sh changes what is there"

# --- SBOM: each library that is needed, each npm package of the page; a licence text for what is inside.
read_sbom() { python3 -c '
import json, sys
for p in json.load(open(sys.argv[1]))["packages"]: print(p["name"], p["versionInfo"], p.get("comment", ""))' "$doc/anchord.spdx.json"; }
named=$(read_sbom) ; pass_or_fail $? "the SBOM cannot be read"
for library in $(readelf -d "$ANCHORD_BINARY" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'); do
  grep -qF " $library" <<<"$named" ; pass_or_fail $? "the SBOM does not name $library"
done
for package in $(awk '{sub(/#.*/, "")} $2 == "@runtime" {print $1}' .ci/packages | grep -vx proj-data); do
  grep -q "^$package " <<<"$named" ; pass_or_fail $? "the SBOM does not name $package"
done
texts=$(zcat "$doc/licences.txt.gz")
for inside in libboost1.81-dev libeigen3-dev libceres-dev libsqlitecpp-dev nlohmann-json3-dev ol papaparse preact uplot @preact/signals; do
  grep -q "^$inside " <<<"$named" ; pass_or_fail $? "the SBOM does not name $inside"
  grep -qE "^$inside [^ ]+ \(in the (executable|dashboard)\)" <<<"$texts" ; pass_or_fail $? "no licence text of $inside"
done
! grep -q "$(date +%Y-%m-%dT)" "$doc/anchord.spdx.json" || [[ $(date +%F) == 2026-09-21 ]]
pass_or_fail $? "the SBOM has the time of the build"
verdict
