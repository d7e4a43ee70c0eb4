#!/usr/bin/env bash
# Makes what docker-compose.yml's profile `cluster` keeps out of the file: passwords, the key of models, a certificate to begin with. What is
# there already stays.
#   docs/examples/cluster/secrets.sh [FOLDER [USER ID]]      secrets, and 65532, as whom the containers of anchord run
# The folder is for its owner alone. Keys and pgpass files must be their reader's own: as another user than root the last line says how.
set -euo pipefail
folder=${1:-secrets} owner=${2:-65532}
umask 077
mkdir -p "$folder"
random() { od -An -tx1 -N"$1" /dev/urandom | tr -d ' \n'; }
# make FILE MODE, its text on stdin
make() {
  local text
  text=$(cat)
  [[ ! -e $folder/$1 ]] || return 0
  printf '%s\n' "$text" >"$folder/$1"
  chmod "$2" "$folder/$1"
}
# Read inside a container by another user than the one who made it.
for name in postgres server worker grafana; do random 16 | make "$name.password" 0444; done
make metrics.token 0444 <<<""   # of a viewer, after the first start: see docker-compose.yml
random 32 | make models.key 0600
make server.pgpass 0600 <<<"*:*:*:anchord:$(cat "$folder/server.password")"
make worker.pgpass 0600 <<<"*:*:*:anchord_worker:$(cat "$folder/worker.password")"
if [[ ! -e $folder/anchord.pem ]] && command -v openssl >/dev/null; then
  # Signed by itself, for this machine; put your own certificate and key in its place.
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 397 -subj /CN=localhost \
    -addext subjectAltName=DNS:localhost,IP:127.0.0.1 -keyout "$folder/key.part" -out "$folder/certificate.part" 2>/dev/null
  cat "$folder/certificate.part" "$folder/key.part" | make anchord.pem 0444
  rm "$folder/certificate.part" "$folder/key.part"
fi
own=("$folder"/models.key "$folder"/*.pgpass)
if ((EUID == owner)); then :; elif ((EUID == 0)); then chown "$owner" "${own[@]}"; else echo "now: sudo chown $owner ${own[*]}"; fi
