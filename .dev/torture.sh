# cmd_torture [KILLS [CUTS]]: see tests/torture/README.md; 1000 kills and 100 power cuts without arguments.
# cmd_torture flight: a flight with everything hostile at once.
cmd_torture() {
  install_packages test
  ensure_node
  ensure_test_packages
  build_preset release anchord power_cut_shim
  export ANCHORD_BINARY=$PWD/$build_dir/anchord
  if [[ ${1:-} == flight ]]; then
    node --test --test-reporter=spec tests/torture/hostile.mjs || die "the hostile flight found something: see above"
    return
  fi
  ANCHORD_POWER_CUT_SHIM=$PWD/$build_dir/tests/torture/libpower_cut_shim.so \
    node tests/torture/torture.mjs "$@" || die "torture found something: see above; the data folder of the failure is kept"
}
