# Node for the dashboard and the end-to-end tests: the machine's own when new enough, else one from npm below build/.

node_minimum=20.19.0   # what Vite 7 asks for; Debian 12 itself has 18
node_private=build/node

node_is_good() {
  local found
  found=$("$1" --version 2>/dev/null) || return 1
  (($(version_number "$found") >= $(version_number "$node_minimum")))
}

ensure_node() {
  if command -v npm >/dev/null && node_is_good node; then return; fi
  if ! node_is_good "$node_private/node_modules/node/bin/node"; then
    if ! command -v npm >/dev/null; then
      local missing_text="nodejs npm"
      say "no npm here: installing Debian's nodejs and npm"
      apt update -o APT::Update::Error-Mode=any || say "apt-get update failed: going on with the package lists at hand"
      apt install -y --no-install-recommends --no-remove nodejs npm || die "apt-get could not install nodejs and npm"
    fi
    say "Node $(node --version 2>/dev/null || echo absent) is older than $node_minimum: installing Node 22 from npm into $node_private"
    mkdir -p "$node_private"
    [[ -e $node_private/package.json ]] || echo '{"private":true}' >"$node_private/package.json"
    npm install --prefix "$node_private" --no-audit --no-fund --loglevel=error node@22 npm@10 ||
      die "npm could not install node@22: is the npm registry reachable?"
    node_is_good "$node_private/node_modules/node/bin/node" || die "node@22 from npm does not run on this machine"
  fi
  export PATH="$PWD/$node_private/node_modules/node/bin:$PWD/$node_private/node_modules/.bin:$PATH"
}
