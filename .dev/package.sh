# cmd_package: the Debian package. Its bytes depend on the commit and the compiler alone: dates are those of the commit.
cmd_package() {
  install_packages
  ensure_node
  build_preset release anchord
  make_package "$PWD/$build_dir"
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
