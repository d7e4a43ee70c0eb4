# Only looks. Layout, bug patterns, headers that stand alone, the two contracts, and the JavaScript of web/ and tests/.

own_sources() {
  git rev-parse --is-inside-work-tree >/dev/null 2>&1 || die "lint and fmt read the list of files from git: no git here, or no repository"
  git ls-files --cached --others --exclude-standard -- '*.cpp' '*.hpp'
}

# What Prettier keeps and ESLint reads; tests/lint/CMakeLists.txt runs the same.
own_scripts=('web/**/*.{ts,tsx,mjs,js,css,html}' 'tests/**/*.mjs')
prettier() { node web/node_modules/prettier/bin/prettier.cjs --log-level warn "$1" "${own_scripts[@]}"; }

# The linters of the dashboard are among its packages.
ensure_web_packages() {
  node web/scripts/install.mjs npm || die "npm ci in web/ failed: see its own message above (is the npm registry reachable?)"
}

cmd_fmt() {
  install_packages lint
  ensure_node
  ensure_web_packages
  own_sources | tr '\n' '\0' | xargs -0 -r clang-format -i
  prettier --write
  say "formatted"
}

# clang-tidy remembers what was clean: a file is looked at again when it, any own header or the rules changed.
tidy() {
  local seen=build/lint failed=0 rules file files mark jobs
  mkdir -p "$seen"
  # Each file as itself: the release build compiles several as one.
  configure_preset tidy
  jobs=$(jobs_count)
  files=$(own_sources | grep '\.cpp$' | grep -v '^tests/')
  rules=$(own_sources | grep '\.hpp$' | tr '\n' '\0' | xargs -0 cat .clang-tidy | sha256sum | cut -c1-16)
  while read -r file; do
    mark=$(sha256sum <"$file" | cut -c1-16)
    mark=$seen/$mark-$rules
    [[ -e $mark ]] || printf '%s\0%s\0' "$file" "$mark"
  done <<<"$files" >"$seen/todo"
  xargs -0 -r -n 2 -P "$jobs" bash -c '
    echo "    $1" >&2
    timeout 300 clang-tidy-16 -p build/tidy --quiet --extra-arg=-Wno-unknown-warning-option "$1" 2>/dev/null && touch "$2"' tidy <"$seen/todo" || failed=1
  return $failed
}

# cmd_lint [layout|bugs|headers|contracts|scripts ...]: all of them without arguments.
cmd_lint() {
  install_packages lint
  ensure_node
  local -a parts=("$@") ; local part ; local wrong=()
  ((${#parts[@]})) || parts=(layout contracts scripts headers bugs)
  for part in "${parts[@]}"; do
    say "lint: $part"
    case $part in
      layout)
        own_sources | tr '\n' '\0' | xargs -0 -r clang-format --dry-run --Werror || wrong+=(layout)
        ensure_web_packages
        prettier --check || wrong+=(prettier) ;;
      scripts)
        ensure_web_packages
        node web/scripts/contract.mjs
        node web/node_modules/eslint/bin/eslint.js --config web/eslint.config.js web tests || wrong+=(eslint) ;;
      contracts)
        ensure_test_packages
        node tests/node_modules/@redocly/cli/bin/cli.js lint --config tests/lint/redocly.yaml api/openapi.yaml || wrong+=(openapi)
        node tests/lint/asyncapi.mjs api/asyncapi.yaml || wrong+=(asyncapi) ;;
      headers) build_preset dev all_verify_interface_header_sets || wrong+=(headers) ;;
      bugs)
        configure_preset release >/dev/null
        tidy || wrong+=(bugs) ;;
      *) die "lint knows layout, contracts, scripts, headers, bugs; not '$part'" ;;
    esac
  done
  ((${#wrong[@]} == 0)) || die "lint found something in: ${wrong[*]} (./dev fmt repairs layout)"
  say "lint is clean"
}
