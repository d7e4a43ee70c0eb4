# cmd_run: build, serve on loopback without login, fill what a server in use holds (anchord simulate site), fly the simulated
# demonstration through the real drivers, again and again.
# ANCHORD_DEMO=drone: an aircraft that stands ready instead, to be planned for and flown from the dashboard.
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
  connect || return 1
  printf 'GET %s HTTP/1.1\r\nHost: %s\r\nConnection: close\r\n\r\n' "$1" "$run_address" >&9 || true
  IFS= read -r -t 2 line <&9 || line=
  exec 9>&- 9<&-
  [[ $line =~ ^HTTP/1\.1\ ([0-9]{3}) ]] && echo "${BASH_REMATCH[1]}"
}
# Descriptor 9 to the server. Nobody there is an answer, not an error to print.
connect() { { exec 9<>"/dev/tcp/${run_address%:*}/${run_address#*:}"; } 2>/dev/null; }

# Status code of POST PATH with a JSON body; the answer's body is left in $reply.
http_post() {
  local line length=0 status LC_ALL=C   # lengths are in bytes
  reply=
  connect || return 1
  printf 'POST %s HTTP/1.1\r\nHost: %s\r\nContent-Type: application/json\r\nContent-Length: %d\r\nConnection: close\r\n\r\n%s' \
    "$1" "$run_address" "${#2}" "$2" >&9 || true
  IFS= read -r -t 5 line <&9 || line=
  status=${line:9:3}
  while IFS= read -r -t 5 line <&9 && [[ $line != $'\r' ]]; do
    [[ ${line,,} =~ ^content-length:\ *([0-9]+) ]] && length=${BASH_REMATCH[1]}
  done
  ((length == 0)) || IFS= read -r -t 5 -N "$length" reply <&9 || true
  exec 9>&- 9<&-
  echo "$status"
}

# Simulated devices on their ports; $devices is what the server is told of them. Fails when they do not come up.
start_devices() {
  local told=build/run-devices.jsonl tries=0
  devices=
  : >"$told"
  "$1" simulate demonstration --json --seed "$2" >"$told" &
  simulator=$!
  run_pids+=("$simulator")
  until (($(wc -l <"$told") >= 2)); do
    kill -0 "$simulator" 2>/dev/null || return 1
    ((++tries <= 50)) || return 1
    sleep 0.2
  done
  devices=$(sed -n 's/.*"kind":"\([a-z]*\)".*"address":"\([^"]*\)".*/\1=\2/p' "$told" | paste -sd,)
  [[ $devices == *pozyx=* && $devices == *gnss=* ]]
}

# A flight of four minutes through the drivers, again and again.
fly_devices() {
  local mission held
  while true; do
    [[ $(http_post /api/v1/missions "{\"name\":\"demonstration\",\"kit\":\"simulated\",\"frame\":\"wgs84\",\"track_point\":\"gnss_antenna\",\"tags\":[{\"tag\":\"0x6e01\",\"antenna\":0,\"lever_arm_body_m\":[0.12,0,-0.28]}]}"; echo "$reply" >build/run-mission.json) == 201 ]] || {
      say "the simulated flight cannot start, the server is up without it: $(cat build/run-mission.json)"
      return
    }
    mission=$(sed -n 's/.*"id":"\([0-9a-f-]*\)".*/\1/p' build/run-mission.json)
    # A flight that an earlier run left recording still has the devices: it is over, and they are free.
    held=$(sed -n 's/.*"held_by":{"mission":"\([0-9a-f-]*\)".*/\1/p' build/run-mission.json)
    if [[ -n $held ]]; then
      http_post "/api/v1/missions/$held/actions" '{"action":"finish"}' >/dev/null
      [[ $(http_post "/api/v1/missions/$mission/actions" '{"action":"take_devices"}') == 200 ]] || return 1
    fi
    for _ in {1..240}; do sleep 1; done
    http_post "/api/v1/missions/$mission/actions" '{"action":"finish"}' >/dev/null ||
      say "the simulated flight could not be finished: no answer from $run_address"
  done
}

cmd_run() {
  cmd_build anchord
  local server=$build_dir/anchord data=build/run-data flight=build/run-flight seed=${ANCHORD_DEMO_SEED:-7} tries=0
  local devices= simulator= reply= server_pid
  [[ -z $(http_status /healthz) ]] || die "something already answers on $run_address: stop it first"
  trap stop_children EXIT
  trap 'stop_children; exit 130' INT
  trap 'stop_children; exit 143' TERM
  mkdir -p "$data"
  local demo=${ANCHORD_DEMO:-devices}
  if [[ $demo == devices ]] && ! start_devices "$server" "$seed"; then
    say "the simulated devices did not come up: the flight is uploaded instead"
    devices=
  fi
  "$server" serve --listen "$run_address" --auth=off --data-dir "$data" ${devices:+--devices "$devices"} \
    $([[ $demo != drone ]] || echo "--drone-address udp://:14550") &
  server_pid=$!
  run_pids+=("$server_pid")
  until [[ $(http_status /readyz) == 200 ]]; do
    kill -0 "$server_pid" 2>/dev/null || die "the server ended at once: see its own message above"
    ((++tries <= 150)) || die "the server is not ready after 30 s: see /readyz on http://$run_address"
    sleep 0.2
  done
  say "anchord is at http://$run_address/  (Ctrl-C ends it; data in $data)"
  # Beside the flight, which waits for nothing: campaign, model, finished flight and revision, once per data folder.
  "$server" simulate site --url "http://$run_address" &
  run_pids+=($!)
  if [[ $demo == drone ]]; then
    "$server" simulate drone --seed "$seed" --url "http://$run_address" &
  elif [[ -n $devices ]]; then
    fly_devices &
  else
    rm -rf "$flight"
    "$server" simulate flight --seed "$seed" --out "$flight" || die "the flight could not be simulated: see above"
    "$server" replay "$flight" --url "http://$run_address" --speed 1 --loop &
  fi
  run_pids+=($!)
  wait "$server_pid" || die "the server ended with exit code $?: see its own message above"
}
