# cmd_cluster: what docs/scale.md calls a cell, on loopback and without containers: PostgreSQL, two servers that stand by for one another, a
# worker with the rights of docs/workers.md, HAProxy by docs/examples/haproxy.cfg and, where it is installed, Prometheus by docs/monitoring.
# This script stands in for the service managers: a server or worker that ends is started again.
cluster_dir=${ANCHORD_CLUSTER_DIR:-$PWD/build/cluster}
cluster_programs=/usr/lib/postgresql/15/bin
declare -A cluster_pid=() cluster_since=() cluster_short=() cluster_due=()

# start_part NAME COMMAND...: in a session of its own, so that Ctrl-C reaches this script alone, which ends them in order. They end with this
# script also when it is killed. ${as[@]} of the caller: as another user.
start_part() {
  local name=$1 ; shift
  setsid env --chdir=/ setpriv ${as[@]+"${as[@]}"} --pdeathsig TERM "$@" </dev/null >>"$cluster_dir/$name.log" 2>&1 &
  cluster_pid[$name]=$!
  cluster_since[$name]=$SECONDS
  disown   # bash has nothing to print where one is killed
}

# The number may be another process's by now: only a child of this script is ever signalled.
lives() { [[ -n ${cluster_pid[$1]:-} ]] && grep -qsx "PPid:[[:space:]]*$$" "/proc/${cluster_pid[$1]}/status"; }

# end_parts SIGNAL NAME...: together; returns when they have ended.
end_parts() {
  local signal=$1 name tries=0 ; shift
  for name in "$@"; do if lives "$name"; then kill -s "$signal" "${cluster_pid[$name]}" 2>/dev/null || true; fi; done
  for name in "$@"; do
    while lives "$name"; do
      ((++tries <= 300)) || { say "$name does not end after 30 s and is killed" ; kill -s KILL "${cluster_pid[$name]}" 2>/dev/null || true; }
      sleep 0.1
    done
    unset "cluster_pid[$name]"
  done
}

# Clients first, the database last; the server that waits before the one that has the database, or it would take over.
stop_cluster() {
  trap '' INT TERM HUP
  trap - EXIT ERR
  ((${#cluster_pid[@]} == 0)) || say "ending"
  end_parts TERM prometheus haproxy worker
  if holds first; then end_parts TERM second; else end_parts TERM first; fi
  end_parts TERM first second
  end_parts INT postgresql   # a fast shutdown: sessions are cut off, the database is whole
}

# holds NAME: that server has the database; the other one listens on no port.
holds() { local run_address=127.0.0.1:${cluster_port[$1]} ; [[ $(http_status /readyz) == 200 ]]; }

# until_true SECONDS NAME WHAT COMMAND...: a part that ended meanwhile, or time that ran out, ends all.
until_true() {
  local seconds=$1 name=$2 what=$3 tries=0 ; shift 3
  until "$@"; do
    lives "$name" || die "$name ended at once: see $cluster_dir/$name.log"
    ((++tries <= seconds * 5)) || die "$what: not within $seconds s, see $cluster_dir/$name.log"
    sleep 0.2
  done
}

# A folder, roles and a database are made once; what an interrupted first start left has nothing in it yet.
make_postgres() {
  local folder=$cluster_dir/postgresql
  rm -rf "$folder"
  install -d -m 0700 "$folder"
  (umask 077 ; cat "$cluster_dir/secrets/postgres.password" >"$folder/password")
  if ((EUID == 0)); then
    chmod a+x "$cluster_dir"
    chown -R postgres: "$folder"
    setpriv "${as[@]}" test -w "$folder" ||
      die "user postgres, as whom PostgreSQL runs for root, cannot reach $folder: run ./dev cluster as an ordinary user, or give another folder in ANCHORD_CLUSTER_DIR"
  fi
  (cd / && setpriv ${as[@]+"${as[@]}"} --pdeathsig TERM "$cluster_programs/initdb" -D "$folder/data" -U postgres --auth=scram-sha-256 \
    --pwfile="$folder/password" -E UTF8 --no-locale --no-sync --no-instructions) >"$cluster_dir/postgresql.log" 2>&1 ||
    die "initdb failed: see $cluster_dir/postgresql.log"
  rm "$folder/password"
}

start_postgres() {
  local made=yes ; local -a as=()
  # It refuses to be root: then it is the user that Debian's package made.
  ((EUID != 0)) || as=(--reuid postgres --regid postgres --clear-groups)
  [[ -e $cluster_dir/made ]] || { made= ; make_postgres; }
  start_part postgresql "$cluster_programs/postgres" -D "$cluster_dir/postgresql/data" -c "port=$PGPORT" -c listen_addresses=127.0.0.1 \
    -c unix_socket_directories=
  until_true 60 postgresql "PostgreSQL answers" "$cluster_programs/pg_isready" -q
  [[ -z $made ]] || return 0
  ANCHORD_SECRETS=$cluster_dir/secrets PGPASSWORD=$(<"$cluster_dir/secrets/postgres.password") \
    psql -X -q -v ON_ERROR_STOP=1 -U postgres -d postgres -f docs/examples/cluster/database.sql
  : >"$cluster_dir/made"
}

start_server() {
  local as=()
  PGPASSFILE=$cluster_dir/secrets/server.pgpass start_part "$1" "$server" serve --listen "127.0.0.1:${cluster_port[$1]}" --data-dir "$cluster_dir/$1" \
    --database "postgresql://anchord@$cluster_database" --standby --trusted-proxies 127.0.0.1
}

start_worker() {
  local as=()
  PGPASSFILE=$cluster_dir/secrets/worker.pgpass start_part worker "$server" worker --database "postgresql://anchord_worker@$cluster_database"
}

start_front() {
  local tls=$cluster_dir/tls as=()
  [[ -e $tls/server.pem ]] || { rm -rf "$tls" ; "$server" tls init --dir "$tls" >/dev/null; }
  "$server" tls show "$tls/server.pem" >/dev/null || "$server" tls renew --dir "$tls" >/dev/null
  (umask 077 ; cat "$tls/server.pem" "$tls/server.key" >"$tls/haproxy.pem")
  ANCHORD_FRONT=127.0.0.1:${cluster_port[haproxy]} ANCHORD_PEM=$tls/haproxy.pem ANCHORD_FIRST=127.0.0.1:${cluster_port[first]} \
    ANCHORD_SECOND=127.0.0.1:${cluster_port[second]} start_part haproxy "$haproxy" -db -f "$PWD/docs/examples/haproxy.cfg"
  until_true 30 haproxy "HAProxy has found a server" env "ANCHORD_CA_FILE=$tls/ca.pem" "$server" healthcheck --url "$cluster_url" >/dev/null 2>&1
}

# The documentation's configuration with both servers as targets of one cluster.
start_prometheus() {
  local into=$cluster_dir/prometheus both as=()
  both="- targets: ['127.0.0.1:${cluster_port[first]}', '127.0.0.1:${cluster_port[second]}']"
  mkdir -p "$into"
  cp docs/monitoring/prometheus/anchord.rules.yml "$into/"
  sed "s/^  - targets: .*/  $both\n    labels: {cluster: here}/" docs/monitoring/prometheus/prometheus.yml >"$into/prometheus.yml"
  start_part prometheus prometheus --config.file "$into/prometheus.yml" --storage.tsdb.path "$into/data" \
    --web.listen-address "127.0.0.1:${cluster_port[prometheus]}"
}

# A part that ended: a server or worker is due again in six seconds. The lease of a server that was killed has run out then, and the one that
# waited has it. One that ends five times within ten seconds stays down, and all with it.
look_after() {
  local name=$1
  unset "cluster_pid[$name]"
  case $name in
    first | second | worker) ;;
    *) die "$name ended: see $cluster_dir/$name.log" ;;
  esac
  if ((SECONDS - cluster_since[$name] < 10)); then cluster_short[$name]=$((${cluster_short[$name]:-0} + 1)); else cluster_short[$name]=0; fi
  ((cluster_short[$name] < 5)) || die "$name ends again and again: see $cluster_dir/$name.log"
  cluster_due[$name]=$((SECONDS + 6))
  say "$name ended, and is started again"
}

start_due() {
  local name
  for name in "${!cluster_due[@]}"; do
    ((SECONDS >= cluster_due[$name])) || continue
    unset "cluster_due[$name]"
    if [[ $name == worker ]]; then start_worker; else start_server "$name"; fi
  done
}

show_cluster() {
  cat >&2 <<TEXT
    $cluster_url/   by HAProxy; clients trust $cluster_dir/tls/ca.pem
    admin token       $cluster_dir/first/admin.token
    servers           http://127.0.0.1:${cluster_port[first]}, http://127.0.0.1:${cluster_port[second]}: one has the database and listens, the other stands by
    database          postgresql://anchord@$cluster_database, passwords in $cluster_dir/secrets
    Prometheus        $([[ -n ${cluster_pid[prometheus]:-} ]] && echo "http://127.0.0.1:${cluster_port[prometheus]}/" || echo "not installed here")
    logs              $cluster_dir/*.log
    who does what     PGPASSFILE=$cluster_dir/secrets/server.pgpass $server doctor --database postgresql://anchord@$cluster_database --data-dir $cluster_dir/first
TEXT
  say "the cluster is up (Ctrl-C ends it; a second start goes on with its database)"
}

cmd_cluster() {
  local server=${ANCHORD_BINARY:-} haproxy name
  if [[ -z $server ]]; then
    install_packages cluster
    cmd_build anchord
    server=$build_dir/anchord
  fi
  [[ $server == /* ]] || server=$PWD/$server
  haproxy=$(PATH=$PATH:/usr/sbin command -v haproxy) || die "there is no haproxy: apt-get install haproxy"
  [[ -x $cluster_programs/initdb ]] || die "there is no $cluster_programs/initdb: apt-get install postgresql-15"
  local -a ports
  read -r -a ports <<<"${ANCHORD_CLUSTER_PORTS:-8430 8431 8432 8433 8434}"
  ((${#ports[@]} == 5)) || die "ANCHORD_CLUSTER_PORTS wants five ports: of HAProxy, both servers, PostgreSQL and Prometheus"
  declare -gA cluster_port=([haproxy]=${ports[0]} [first]=${ports[1]} [second]=${ports[2]} [postgresql]=${ports[3]} [prometheus]=${ports[4]})
  for name in "${!cluster_port[@]}"; do
    run_address=127.0.0.1:${cluster_port[$name]}
    if connect; then die "something already answers on $run_address: stop it, or give five other ports in ANCHORD_CLUSTER_PORTS"; fi
  done
  cluster_url=https://127.0.0.1:${cluster_port[haproxy]} cluster_database=127.0.0.1:${cluster_port[postgresql]}/anchord
  mkdir -p "$cluster_dir"
  rm -f "$cluster_dir"/*.log
  trap stop_cluster EXIT
  trap 'exit 130' INT
  trap 'exit 143' TERM
  trap 'exit 129' HUP
  docs/examples/cluster/secrets.sh "$cluster_dir/secrets" "$EUID"
  export PGHOST=127.0.0.1 PGPORT=${cluster_port[postgresql]}
  start_postgres
  # What one server signed the other one must trust.
  for name in first second; do
    [[ -e $cluster_dir/$name ]] || { install -d -m 0700 "$cluster_dir/$name" && cp -p "$cluster_dir/secrets/models.key" "$cluster_dir/$name/"; }
  done
  start_server first
  until_true 120 first "the first server is ready" holds first
  start_server second
  until_true 60 second "the second server stands by" grep -q 'standing by' "$cluster_dir/second.log"
  PGUSER=anchord PGDATABASE=anchord PGPASSFILE=$cluster_dir/secrets/server.pgpass docs/examples/cluster/worker_rights.sh docs/workers.md
  start_worker
  start_front
  if command -v prometheus >/dev/null; then start_prometheus; fi
  show_cluster
  while true; do
    sleep 0.5
    start_due
    for name in "${!cluster_pid[@]}"; do [[ -d /proc/${cluster_pid[$name]} ]] || look_after "$name"; done
  done
}
