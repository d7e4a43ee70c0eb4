# Checks that need no build of the product beyond its compile commands.

own_sources() { git ls-files -- '*.cpp' '*.hpp' | grep -v '^build/' || true; }

cmd_fmt() {
  install_packages lint
  own_sources | tr '\n' '\0' | xargs -0 -r clang-format -i
  say "formatted"
}

cmd_lint() {
  install_packages lint
  local failed=0
  say "clang-format"
  own_sources | tr '\n' '\0' | xargs -0 -r clang-format --dry-run --Werror || { failed=1; }
  ((failed == 0)) || die "lint found something: see above (./dev fmt repairs layout)"
  say "lint is clean"
}
