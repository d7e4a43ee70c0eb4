# Where this machine gets Debian 12 from, as lines of a sources.list. Sourced, never run: by ./dev and by tests/dev/bare_root.sh.
debian_sources() {
  apt-get indextargets --format 'deb $(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' 2>/dev/null |
    awk '$3 ~ /^bookworm(-updates|-security)?$/ && $4 == "main"'
}
