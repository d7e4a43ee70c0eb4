#pragma GCC diagnostic ignored "-Wmisleading-indentation"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/made_kits.hpp"
#include "tests/core/localize/flight_support.hpp"
namespace anchord { namespace {
using testing::KitFlight; using testing::Random; using testing::Spoilage;
struct T { int n{0}, in{0}, acc{0}, acc_in{0}, acc_15{0}; double err{0}; std::vector<double> claims;
  std::map<std::string,int> failed;
  void add(const AnchorSolution& a, const Eigen::Vector3d& truth) {
    const Estimate& e = a.estimate; if (!e.best) return;
    const Eigen::Vector3d off = e.best->position.m - truth;
    const double far = off.dot(e.best->covariance_m2.inverse()*off)/7.815;
    if (std::getenv("VV") && far>=1 && e.acceptable()) { auto es = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(e.best->covariance_m2); std::printf("   out %s off %.2f %.2f %.2f far %.2f sig %.2f %.2f %.2f main dir %.2f %.2f %.2f b %.2f\n", a.name.c_str(), off.x(), off.y(), off.z(), std::sqrt(far), std::sqrt(es.eigenvalues()[0]), std::sqrt(es.eigenvalues()[1]), std::sqrt(es.eigenvalues()[2]), es.eigenvectors().col(2).x(), es.eigenvectors().col(2).y(), es.eigenvectors().col(2).z(), e.bias_m.value_or(0)); }
    ++n; in += far<1; err += off.norm(); claims.push_back(std::sqrt(e.best->covariance_m2.trace()));
    for (auto& g : e.gates) if(!g.passed) ++failed[g.name];
    if (e.verdict!=Verdict::ok) ++failed["verdict"];
    if (!e.acceptable()) return;
    ++acc; acc_in += far<1; acc_15 += far>2.25;
  }
  void print(const char* w) { std::sort(claims.begin(),claims.end());
    std::printf("%-34s n %4d inside %5.1f%% err %.3f claim %.3f | accepted %4d inside %4d far %3d |", w, n, 100.0*in/std::max(n,1), err/std::max(n,1), claims.empty()?0:claims[claims.size()/2], acc, acc_in, acc_15);
    for (auto&[k,v]:failed) std::printf(" %s %d", k.c_str(), v); std::printf("\n"); std::fflush(stdout);} };
TEST(Exp, Arm) {
  const int N = std::getenv("N") ? std::atoi(std::getenv("N")) : 12;
  for (double arm : {0.0, 0.3}) for (int mode = 0; mode < 8; ++mode) { T t;
    for (int k = 0; k < N; ++k) { Random random(500 + k);
      KitFlight made = testing::fly(testing::draw_kit(0.0, random), "made", random);
      const double way = std::uniform_real_distribution<double>(0, 6.28)(random);
      made.flight.mission.tags[0].lever_arm_body_m = {arm*std::cos(way), arm*std::sin(way), 0};
      const double swing[] = {0,0,0,5,10,20,45,0};
      for (Fix& fix : made.flight.fixes) { const double ts = seconds_between(UtcTime{}, fix.time);
        const double h = mode==1 ? 0.2*ts : mode==7 ? (ts>40 ? 1.57 : 0) : swing[mode]*M_PI/180*std::sin(0.3*ts);
        if (mode) fix.enu_from_body = Eigen::Quaterniond(Eigen::AngleAxisd(h, Eigen::Vector3d::UnitZ())); }
      const auto s = solve_flight(made.flight, made.options());
      for (auto& a : s.value().anchors) t.add(a, made.truth_m.at(a.estimate.anchor));
    }
    const char* names[] = {"course","turning","one heading","swing 5","swing 10","swing 20","swing 45","one quarter turn"};
    char w[80]; std::snprintf(w, sizeof w, "arm %.1f %s", arm, names[mode]); t.print(w);
  }
}
// late from one side: constant delay, or exponential
TEST(Exp, Side) {
  const int N = std::getenv("N") ? std::atoi(std::getenv("N")) : 20;
  const bool quick = std::getenv("QUICK");
  for (double mean : quick ? std::vector<double>{0.5, 2.0} : std::vector<double>{0.2, 0.3, 0.5, 1.0, 2.0, 4.0}) for (int kind = 0; kind < 2; ++kind)
  for (double share : quick ? std::vector<double>{0.3,0.5} : std::vector<double>{0.15, 0.3, 0.5, 0.7}) { T t;
    for (int k = 0; k < N; ++k) { Random random(77 + k);
      const double size = std::uniform_real_distribution<double>(0, 1)(random);
      const auto kit = testing::draw_kit(size < 0.5 ? 0.0 : 0.7*size, random);
      KitFlight made = testing::fly(kit, "made", random);
      Random r2(9000 + k);
      std::map<NetworkId,double> from; std::exponential_distribution<double> ex(1.0);
      const double common = std::uniform_real_distribution<double>(0, 6.283)(r2);
      for (auto& [id, p] : made.truth_m) from[id] = k%2 ? common : std::uniform_real_distribution<double>(0, 6.283)(r2);
      for (auto& r : made.flight.ranges) {
        const auto& p = made.truth_m.at(r.anchor);
        auto f = std::min_element(made.flight.fixes.begin(), made.flight.fixes.end(), [&](auto&a, auto&b){ return std::abs(a.time.ns-r.time.ns) < std::abs(b.time.ns-r.time.ns);});
        const Eigen::Vector3d ray = p - f->local_m;
        const double d = std::remainder(std::atan2(ray.y(), ray.x()) - from[r.anchor], 2*M_PI);
        if (std::abs(d) < share*M_PI) r.distance_m += kind==0 ? mean : 0.6*mean + 0.4*mean*ex(r2);
      }
      const auto s = solve_flight(made.flight, made.options());
      for (auto& a : s.value().anchors) t.add(a, made.truth_m.at(a.estimate.anchor));
    }
    char w[80]; std::snprintf(w, sizeof w, "late %.1f m %s %2.0f %%", mean, kind?"0.6+exp":"constant", 100*share); t.print(w);
  }
}
TEST(Exp, Clean) {
  T t; for (int k = 0; k < 100; ++k) { Random random(77 + k);
      const double size = std::uniform_real_distribution<double>(0, 1)(random);
      const auto kit = testing::draw_kit(size < 0.5 ? 0.0 : 0.7*size, random);
      KitFlight made = testing::fly(kit, "made", random);
      const auto s = solve_flight(made.flight, made.options());
      for (auto& a : s.value().anchors) { t.add(a, made.truth_m.at(a.estimate.anchor));
       if (std::getenv("V")) for (auto& g : a.estimate.gates) if (g.name=="unseen_arm") std::printf("   V %d %s %.3f/%.3f = %.2f h95 %.3f v95 %.3f %s\n", k, a.name.c_str(), g.value.value_or(-1), g.limit, g.value.value_or(0)/g.limit, a.estimate.h95_m, a.estimate.v95_m, g.why.c_str()); } }
  t.print("clean kits");
  T u; for (int k = 0; k < 20; ++k) { testing::MadeFlight m; m.seed = 100+k; m.turn_rate_radps = k%2?0.2:0.0; const auto s = solve_flight(testing::make_flight(m));
      for (std::size_t i = 0; i < 4; ++i) u.add(s.value().anchors[i], m.anchors[i]); }
  u.print("clean MadeFlight");
}
} }
