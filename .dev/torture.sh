# cmd_torture [KILLS [CUTS]]: see tests/torture/README.md; 1000 kills and 100 power cuts without arguments.
# cmd_torture flight: a flight with everything hostile at once.
# cmd_torture cluster [ROUNDS]: two servers on one PostgreSQL, one fault a round; 30 without an argument.
cmd_torture() {
  install_packages test
  ensure_node
  ensure_test_packages
  build_preset release anchord power_cut_shim
  export ANCHORD_BINARY=$PWD/$build_dir/anchord
  if [[ ${1:-} == cluster ]]; then
    shift
    node tests/torture/cluster.mjs "$@" || die "the cluster's torture found something: see above; logs and databases of the failure are kept"
    return
  fi
  if [[ ${1:-} == flight ]]; then
    node --test --test-reporter=spec tests/torture/hostile.mjs || die "the hostile flight found something: see above"
    return
  fi
  ANCHORD_POWER_CUT_SHIM=$PWD/$build_dir/tests/torture/libpower_cut_shim.so \
    node tests/torture/torture.mjs "$@" || die "torture found something: see above; the data folder of the failure is kept"
}
