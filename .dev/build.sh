configure_preset() {
  local preset=$1 ; local -a settings=()
  [[ -d $private_boost_dir/usr ]] && settings+=("-DCMAKE_PREFIX_PATH=$PWD/$private_boost_dir/usr")
  say "configuring $preset"
  cmake --preset "$preset" "${settings[@]}" || die "cmake --preset $preset failed: see its own message above"
}

# build_preset PRESET [ninja targets...]: configure and build, with progress.
build_preset() {
  local preset=$1 jobs ; shift
  configure_preset "$preset"
  jobs=$(jobs_count)
  say "building $preset with $jobs jobs"
  NINJA_STATUS='[%f/%t %es] ' ninja -C "build/$preset" -j "$jobs" "$@" ||
    die "the build failed: see its own message above"
}

cmd_setup() {
  install_packages
  ensure_node
  configure_preset release
  say "ready to build: ./dev build"
}

cmd_build() {
  install_packages
  ensure_node
  build_preset release "$@"
  say "built $build_dir/anchord"
}

cmd_clean() {
  # The database of ./dev run and private tools go too: everything the project makes lies in build/ and node_modules.
  rm -rf build web/node_modules tests/node_modules
  say "removed build/, web/node_modules, tests/node_modules"
}
