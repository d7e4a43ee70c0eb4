// RMSE over the Cramer-Rao bound and coverage of the 95 % regions, as JSON for bench.mjs.
#include <cstdio>
#include <cstdlib>

#include "tests/core/localize/cramer_rao.hpp"

int main(int argc, char** argv) {
  using namespace anchord::testing;
  const int flights = argc > 1 ? std::atoi(argv[1]) : 400;
  const auto line = [&](const char* name, Ranges ranges, const char* end) {
    const CramerRao c = cramer_rao(ranges, flights, 11);
    std::printf("\"%s\":{\"ratio\":%.4f,\"coverage\":%.4f,\"rmse_m\":%.5f}%s\n", name, c.rmse_over_bound,
                c.coverage, c.rmse_m, end);
  };
  std::printf("{\"flights\":%d,\n", flights);
  line("labelled", Ranges::labelled, ",");
  line("unlabelled", Ranges::unlabelled, ",");
  line("unmodelled", Ranges::unmodelled, "}");
  return 0;
}
