# The server and CLI for the companion computer of an aircraft (arm64), built on this machine by Debian's cross compiler.
arm64_root=build/arm64-root

# arm64_names: Debian's arm64 packages that are linked and that the executable needs to run: what .ci/packages lists without the tools.
arm64_names() {
  echo libc6-dev
  package_names runtime | grep -E -e '-dev$|^lib|-data$'
}

# make_arm64_root: these packages, unpacked below build/arm64-root. Nothing in them is configured or run by this machine's apt.
make_arm64_root() {
  local names stamp sources mirror made=0 ; local -a lines=()
  names=$(arm64_names)
  stamp=$(sha256sum <<<"$names")
  [[ -f $arm64_root/.made && $(<"$arm64_root/.made") == "$stamp" ]] && return
  sources=$(debian_sources)
  [[ -n $sources ]] || die "apt here has no lists of Debian 12 bookworm: apt-get update"
  mirror=$(awk '{$1 = "deb [arch=arm64]"; print}' <<<"$sources")
  mapfile -t lines <<<"$mirror"
  say "unpacking Debian's arm64 libraries into $arm64_root"
  rm -rf --one-file-system "$arm64_root"
  mmdebstrap --quiet --variant=extract --architectures=arm64 --include="$(tr '\n' ' ' <<<"$names")" \
    bookworm "$arm64_root" "${lines[@]}" || made=$?
  ((made == 0)) || die "mmdebstrap could not unpack Debian's arm64 packages: see its own message above (is the mirror reachable, and has it arm64?)"
  # Where Debian's maintainer scripts, which are not run here, put the libraries that stand for BLAS and LAPACK.
  local folder
  for folder in blas lapack atlas; do
    [[ ! -d $arm64_root/usr/lib/aarch64-linux-gnu/$folder ]] ||
      find "$arm64_root/usr/lib/aarch64-linux-gnu/$folder" -maxdepth 1 -name 'lib*.so*' -exec ln -srf -t "$arm64_root/usr/lib/aarch64-linux-gnu" {} +
  done
  # Debian's CMake files of Ceres name libraries by the paths of the machine they were built on.
  find "$arm64_root/usr/lib/aarch64-linux-gnu/cmake/Ceres" -name '*.cmake' -exec sed -i 's#;/usr/lib/#;${CMAKE_SYSROOT}/usr/lib/#g' {} +
  printf '%s\n' "$stamp" >"$arm64_root/.made"
}

# build_arm64: build/arm64/anchord.
build_arm64() {
  install_packages arm64
  ensure_node
  make_arm64_root
  build_preset arm64 anchord
}

# arm64_tests: what was built, run under emulation, beside this machine's own build.
arm64_tests() {
  build_preset release anchord
  build_arm64
  say "testing build/arm64/anchord under qemu"
  ANCHORD_BINARY=$PWD/$build_dir/anchord ARM64_BINARY=$PWD/build/arm64/anchord ARM64_ROOT=$PWD/$arm64_root tests/dev/arm64.test.sh
}
