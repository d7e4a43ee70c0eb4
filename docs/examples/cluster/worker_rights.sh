#!/usr/bin/env bash
# Gives workers their rights once the server has made its tables: the GRANT lines of docs/workers.md. Safe to repeat.
#   PGHOST=... PGUSER=anchord PGDATABASE=anchord PGPASSFILE=... worker_rights.sh workers.md
set -euo pipefail
rights=$(sed -nE 's/^    (GRANT .*;)$/\1/p' "$1")
[[ -n $rights ]] || { echo "$1 has no line that begins with GRANT" >&2 ; exit 1; }
ask() { psql -X -q -A -t -v ON_ERROR_STOP=1 "$@"; }
until [[ $(ask -c "SELECT to_regclass('server_lease') IS NOT NULL" 2>/dev/null) == t ]]; do sleep 0.5; done
ask -1 -c "$rights"
