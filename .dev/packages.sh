# Installs what .ci/packages lists and this machine lacks. Silent and offline when nothing is missing.

# Names of the wanted groups: `package_names` alone gives the ungrouped ones, `package_names lint` those and @lint.
package_names() {
  awk -v groups=" $* " '
    { sub(/#.*/, "") }
    NF == 0 { next }
    NF == 1 { print $1; next }
    index(groups, " " substr($2, 2) " ") { print $1 }' .ci/packages
}

is_installed() { [[ $(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null) == installed ]]; }

# A command as root.
as_root() {
  local -a root=()
  if ((EUID != 0)); then
    command -v sudo >/dev/null || die "not root and no sudo: run as root: apt-get install -y --no-install-recommends $missing_text"
    root=(sudo)
  fi
  "${root[@]}" "$@"
}

# apt-get as root, without questions.
apt() {
  # A machine just started may be installing its updates: wait for it.
  as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300 "$@"
}

# libboost1.81-dev declares a conflict with every other libboost*-dev. Where such a one is installed it stays (other
# software of the machine may want it): ours is unpacked below build/ and found there, headers are all we use.
private_boost_dir=build/boost-1.81
other_boost() {
  # dpkg-query fails where the pattern matches nothing, which is what every fresh machine answers.
  { dpkg-query -W -f='${Package} ${db:Status-Status}\n' 'libboost1.*-dev' 2>/dev/null || true; } |
    awk '$2 == "installed" && $1 ~ /^libboost1\.[0-9]+-dev$/ && $1 != "libboost1.81-dev" && !found {print $1; found = 1}'
}
unpack_private_boost() {
  [[ -e $private_boost_dir/usr/include/boost/version.hpp ]] && return
  say "$1 is installed and conflicts with libboost1.81-dev: unpacking the latter into $private_boost_dir"
  rm -rf "$private_boost_dir" && mkdir -p "$private_boost_dir/deb"
  (cd "$private_boost_dir/deb" && apt-get -q download libboost1.81-dev) ||
    die "cannot download Debian package libboost1.81-dev: are the sources and the network in order? (apt-get update)"
  dpkg -x "$private_boost_dir"/deb/*.deb "$private_boost_dir"
}

# install_packages [GROUP...]
install_packages() {
  command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
    die "this needs Debian 12: no apt-get here. Install the packages of .ci/packages by other means and call cmake --preset release"
  local -a missing=() ; local name names boost_conflict missing_text network=
  boost_conflict=$(other_boost)
  names=$(package_names "$@")
  [[ -n $names ]] || die ".ci/packages lists nothing: is this checkout complete?"
  while read -r name; do
    [[ $name == libboost1.81-dev && -n $boost_conflict ]] && continue
    is_installed "$name" || missing+=("$name")
  done <<<"$names"
  if ((${#missing[@]})); then
    missing_text="${missing[*]}"
    say "installing ${#missing[@]} Debian packages: $missing_text"
    # Error-Mode: without it a machine with no network "updates" with exit code 0.
    apt update -o APT::Update::Error-Mode=any || {
      network="; apt-get update failed too: is there a network?"
      say "apt-get update failed: going on with the package lists at hand"
    }
    for name in "${missing[@]}"; do
      apt-cache show "$name" >/dev/null 2>&1 ||
        die "Debian package '$name' is not available from the sources of this machine (needed: Debian 12 bookworm, main)$network"
    done
    # Debian's PostgreSQL would make a database and serve it for good; the tests start their own and end it.
    local no_cluster=
    if [[ " $missing_text " == *" postgresql-15 "* ]]; then
      no_cluster=/etc/postgresql-common/createcluster.d/anchord.conf
      as_root mkdir -p "${no_cluster%/*}"
      as_root tee "$no_cluster" >/dev/null <<<'create_main_cluster = false'
    fi
    local installed=0
    # --no-remove: nothing of the user's goes away for our sake.
    apt install -y --no-install-recommends --no-remove "${missing[@]}" || installed=$?
    [[ -z $no_cluster ]] || as_root rm -f "$no_cluster"
    ((installed == 0)) ||
      die "apt-get could not install: $missing_text (see its own message above)$network"
  fi
  if [[ -n $boost_conflict ]]; then unpack_private_boost "$boost_conflict"; fi
}
