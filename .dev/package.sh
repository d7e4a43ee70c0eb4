# cmd_package [--arm64]: the Debian package. Its bytes depend on the commit and the compiler alone: dates are those of the commit.
cmd_package() {
  [[ -z ${1:-} || $1 == --arm64 ]] || die "package knows --arm64 (for the companion computer of an aircraft); not '$1'"
  install_packages
  if [[ ${1:-} == --arm64 ]]; then
    build_arm64
    make_package "$PWD/build/arm64"
  else
    ensure_node
    build_preset release anchord
    make_package "$PWD/$build_dir"
  fi
}

# make_package BUILD_FOLDER [cpack arguments...]: of what is built there.
make_package() {
  local folder=$1 ; shift
  if [[ -z ${SOURCE_DATE_EPOCH:-} ]]; then
    SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2>/dev/null) ||
      die "no git here to date the package by: set SOURCE_DATE_EPOCH to the seconds since 1970 of this version"
  fi
  export SOURCE_DATE_EPOCH
  say "packaging (dates: $(date -u -d "@$SOURCE_DATE_EPOCH" +%F))"
  (cd "$folder" && umask 022 && cpack -G DEB "$@" >package.log 2>&1) ||
    { tail -n 20 "$folder/package.log" >&2; die "cpack failed: see $folder/package.log"; }
  say "made $(find "$folder" -maxdepth 1 -name 'anchord_*.deb' -newer "$folder/CPackConfig.cmake" -printf '%T@ %p\n' | sort -n | tail -n 1 | cut -d' ' -f2-)"
}
