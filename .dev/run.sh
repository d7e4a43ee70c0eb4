# cmd_run: build, serve on loopback without login, fly the simulated demonstration flight in a loop.
run_address=127.0.0.1:8420
run_pids=()

stop_children() {
  trap - EXIT INT TERM
  local pid
  for pid in "${run_pids[@]}"; do kill -TERM "$pid" 2>/dev/null || true; done
  for pid in "${run_pids[@]}"; do wait "$pid" 2>/dev/null || true; done
}

# Status code of GET PATH on the running server; bash's own sockets, so that curl is not needed.
http_status() {
  local line
  exec 9<>"/dev/tcp/${run_address%:*}/${run_address#*:}" || return 1
  printf 'GET %s HTTP/1.1\r\nHost: %s\r\nConnection: close\r\n\r\n' "$1" "$run_address" >&9
  IFS= read -r -t 2 line <&9 || line=
  exec 9>&- 9<&-
  [[ $line =~ ^HTTP/1\.1\ ([0-9]{3}) ]] && echo "${BASH_REMATCH[1]}"
} 2>/dev/null

cmd_run() {
  cmd_build anchord
  local server=$build_dir/anchord data=build/run-data flight=build/run-flight seed=${ANCHORD_DEMO_SEED:-7} tries=0
  [[ -z $(http_status /healthz) ]] || die "something already answers on $run_address: stop it first"
  trap stop_children EXIT
  trap 'stop_children; exit 130' INT
  trap 'stop_children; exit 143' TERM
  mkdir -p "$data"
  "$server" serve --listen "$run_address" --auth=off --data-dir "$data" &
  run_pids+=($!)
  until [[ $(http_status /readyz) == 200 ]]; do
    kill -0 "${run_pids[0]}" 2>/dev/null || die "the server ended at once: its own message stands above"
    ((++tries <= 150)) || die "the server is not ready after 30 s: see /readyz on http://$run_address"
    sleep 0.2
  done
  say "anchord is at http://$run_address/  (Ctrl-C ends it; data in $data)"
  rm -rf "$flight"
  "$server" simulate flight --seed "$seed" --out "$flight"
  "$server" replay "$flight" --url "http://$run_address" --speed 1 --loop &
  run_pids+=($!)
  wait "${run_pids[0]}"
}
