cmd_bench() { die "no benchmarks are registered yet"; }
cmd_fuzz() { die "no fuzz targets are registered yet"; }
